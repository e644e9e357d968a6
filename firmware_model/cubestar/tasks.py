"""Values of telemetry TaskStatus for telecommands that report their progress in no other way.

Captures, detection, identification and attitude estimate report theirs step by step, also in the
loop. A task without a failed state ends as done: the error flags report the outcome.
"""

from typing import NamedTuple

from cubestack.firmware_model.interface.cubestar.codes import TaskStatus


class Task(NamedTuple):
    """States of a telecommand: in progress, done, failed."""

    begun: TaskStatus
    done: TaskStatus
    failed: TaskStatus | None = None


_WRITE = Task(TaskStatus.WRITING_SENSOR, TaskStatus.SENSOR_WRITTEN)
_READ = Task(TaskStatus.READING_SENSOR, TaskStatus.SENSOR_READ)

#: By telecommand. A parameter out of range fails at once, with the task's failed state, if any.
TASKS = {
    "Exposure": Task(
        TaskStatus.SETTING_EXPOSURE, TaskStatus.EXPOSURE_SET, TaskStatus.EXPOSURE_FAILED
    ),
    "WriteTo_IS_Register": _WRITE,
    "WriteCameraRegister": _WRITE,
    "ReadFrom_IS_Register": _READ,
    "SelectCameraRegister": _READ,
    # One upload is many telecommands: it is in progress until a block was received.
    "UploadImage": Task(
        TaskStatus.RECEIVING_IMAGE, TaskStatus.RECEIVING_IMAGE, TaskStatus.RECEIVING_FAILED
    ),
    "UploadBlock": Task(
        TaskStatus.RECEIVING_IMAGE, TaskStatus.IMAGE_RECEIVED, TaskStatus.RECEIVING_FAILED
    ),
    "ImageBlockSet": Task(TaskStatus.SETTING_BLOCK, TaskStatus.BLOCK_SET, TaskStatus.BLOCK_FAILED),
    "TestSRAM": Task(TaskStatus.TESTING_SRAM, TaskStatus.SRAM_TESTED),
    "CaptureTestPatern": Task(
        TaskStatus.CAPTURING_PATTERN, TaskStatus.PATTERN_CAPTURED, TaskStatus.PATTERN_FAILED
    ),
    "SelectBestStars": Task(
        TaskStatus.FINDING_BEST_STARS, TaskStatus.BEST_STARS_FOUND, TaskStatus.BEST_STARS_FAILED
    ),
    "StreamDownImage": Task(TaskStatus.STREAMING_IMAGE, TaskStatus.IMAGE_STREAMED),
}
