"""Registers of the encryption accelerator. EFM32GG Reference Manual, chapter 31."""

from cubestack.firmware_model.interface.efm32gg.table import Instance, peripheral

AES = peripheral(
    "AES",
    "Advanced encryption standard accelerator; chapter 31",
    """
    000 CTRL      rw  00000000  DECRYPT:0 AES256:1 KEYBUFEN:2 DATASTART:4 XORSTART:5 BYTEORDER:6
    004 CMD       w   00000000  START:0 STOP:1
    008 STATUS    r   00000000  RUNNING:0
    00C IEN       rw  00000000  DONE:0
    010 IF        r   00000000  DONE:0
    014 IFS       w   00000000  DONE:0
    018 IFC       w   00000000  DONE:0
    01C DATA      rwa 00000000  *
    020 XORDATA   rwa 00000000  *
    030/4 KEYL{ABCD} rwa 00000000  *
    040/4 KEYH{ABCD} rwa 00000000  *
    """,
    Instance("AES", 0x400E0000, {"AES": 36}),
)
