# docker build -t cubestack .
# docker run --rm cubestack measure cubestar --frames 3
# docker run --rm -p 127.0.0.1:5000:5000 cubestack emulate cubestar --tcp 5000 --listen 0.0.0.0 --allow-remote
FROM python:3.11-slim AS build
COPY . /source
WORKDIR /source
RUN python -m venv /opt/builder && /opt/builder/bin/pip install --no-cache-dir -e ".[release]" \
    && /opt/builder/bin/python -m cubestack.host.native.wheels /wheels "manylinux_2_17_$(uname -m)"
RUN python -m venv /opt/cubestack \
    && /opt/cubestack/bin/pip install --no-cache-dir "cubestack[ground] @ file://$(ls /wheels/*.whl)" \
    && find /opt/cubestack -name __pycache__ -prune -exec rm -r {} +

# No compiler: the wheel contains the compiled FPGA designs of the shipped sensors.
FROM python:3.11-slim
RUN useradd --create-home cubestack
COPY --from=build /opt/cubestack /opt/cubestack
ENV PATH=/opt/cubestack/bin:$PATH
USER cubestack
WORKDIR /home/cubestack
ENTRYPOINT ["cubestack"]
CMD ["--help"]
