"""Telecommands of the protocol suite: sent, and waited for until they are processed."""

from collections.abc import Mapping

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.host.conformance.suite import FailedError, Suite
from cubestack.host.errors import NoAnswerError, NodeError

__all__ = ["perform"]

PROCESSING_TIMEOUT_S = 15.0
RESTART_TIMEOUT_S = 10.0
RESTART_POLL_S = 0.25


def perform(suite: Suite, message: Message, values: Mapping[str, Value]) -> None:
    """Send it, and wait until it is processed; after a restart, until the node answers again."""
    node = suite.target.node
    node.command(message.name, **values)
    try:
        node.wait_processed(PROCESSING_TIMEOUT_S)
    except NoAnswerError:
        _wait_restarted(suite, message)


def _wait_restarted(suite: Suite, message: Message) -> None:
    for _ in range(int(RESTART_TIMEOUT_S / RESTART_POLL_S)):
        try:
            suite.target.node.telemetry(suite.target.interface.telemetries[0].name)
            return
        except NodeError:
            suite.target.node.pause(RESTART_POLL_S)
    raise FailedError(f"no answer for {RESTART_TIMEOUT_S:g} s after {message.name}")
