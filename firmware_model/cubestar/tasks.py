"""What telemetry TaskStatus says of telecommands that report their own progress in no other way.

Captures, detection, identification and attitude estimate report theirs step by step, also in the
loop. A task without a failed state ends as done: the error flags tell how it went.
"""

from typing import NamedTuple

from cubestack.firmware_model.interface.cubestar.codes import TaskStatus


class Task(NamedTuple):
    """States while a telecommand is carried out, and when it has been, or could not be."""

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
    # One upload is many telecommands: it is being received until a block has come.
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
