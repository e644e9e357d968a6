"""The page in the browser, and the control port."""

from importlib.util import find_spec

from cubestack.host.errors import install_command

for _name in ("starlette", "uvicorn", "websockets"):
    if find_spec(_name) is None:
        raise ValueError(f"this needs {_name}: {install_command('ground')}")
