"""Protocol between the host and a development board that runs a design behind its serial port.

The board is the slave: it answers each request once, and sends nothing on its own. Sides of a pin
are named from the FPGA.

Time. The host owns virtual time; the board has none. A board changes its design's inputs only in
steps: the inputs of one step change together, the design settles, and the outputs are taken. A
clock or an asynchronous reset needs a step of its own, after those of the inputs that it samples.
The host assigns a virtual time to each step and assumes that the outputs changed at that time.
Between two steps nothing changes, however long the host waits or the board takes. The delays of the
FPGA are not visible.

Link. Each frame is numbered. A board executes the requests in the order of their numbers, each one
once. It keeps the latest :data:`RESPONSES` responses: a request that it has executed already is
answered by the stored response. A request that is out of order, or damaged, is answered by NAK,
which carries the number of the request that the board waits for. The host repeats from that one,
and when no response comes. At most :data:`WINDOW` requests may be without a response, and their
bytes in the board, by :func:`buffered`, must not exceed :data:`BUFFER`; the board drops what does
not fit, as if it were damaged. A board answers CLOSED until it gets HELLO, which sets
the number to wait for, so a board that lost its power in between is noticed.

Early ends. A request may end early, with a status other than OK, and reports how many edges or
steps it has executed. A request with the flag :data:`CHAINED` is then answered SKIPPED and
not executed, so a host can send requests that depend on the success of those before. A request
without the flag is always executed.

:mod:`~.address` has the form of a board's name, :mod:`~.table` declares operations, statuses and
limits, :mod:`~.frames` codes frames, :mod:`~.layout` packs pins, :mod:`~.outputs` has the predicted
outputs by which responses are short.
"""

from cubestack.firmware_model.interface.devboard.address import BoardAddress, parse_address
from cubestack.firmware_model.interface.devboard.frames import (
    Frame,
    FrameDecoder,
    buffered,
    encode_frame,
)
from cubestack.firmware_model.interface.devboard.layout import Camera, Layout, Lines, Memory
from cubestack.firmware_model.interface.devboard.outputs import (
    Deviation,
    Outputs,
    decode_deviations,
    encode_deviation,
)
from cubestack.firmware_model.interface.devboard.table import (
    BUFFER,
    CHAINED,
    LONGEST_REQUEST,
    OPERATIONS,
    RESPONSES,
    VERSION,
    WINDOW,
    Code,
    Identity,
    Operation,
    ProtocolError,
    Response,
    Status,
    Step,
)

__all__ = [
    "BUFFER",
    "CHAINED",
    "LONGEST_REQUEST",
    "OPERATIONS",
    "RESPONSES",
    "VERSION",
    "WINDOW",
    "BoardAddress",
    "Camera",
    "Code",
    "Deviation",
    "Frame",
    "FrameDecoder",
    "Identity",
    "Layout",
    "Lines",
    "Memory",
    "Operation",
    "Outputs",
    "ProtocolError",
    "Response",
    "Status",
    "Step",
    "buffered",
    "decode_deviations",
    "encode_deviation",
    "encode_frame",
    "parse_address",
]
