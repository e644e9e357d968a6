"""Registers of the DMA controller.

EFM32GG Reference Manual, chapter 8; PrimeCell uDMA Controller (PL230) TRM.
"""

from cubestack.firmware_model.interface.efm32gg.table import Instance, peripheral

DMA = peripheral(
    "DMA",
    "DMA controller, a PL230 with 12 channels; chapter 8",
    """
    0000   STATUS        r  100B0000  EN:0 STATE:4:4 CHNUM:16:5 TESTSTATUS:28:4
    0004   CONFIG        w  00000000  EN:0 CHPROT:5
    0008   CTRLBASE      rw 00000000  *
    000C   ALTCTRLBASE   r  00000100  *
    0010   CHWAITSTATUS  r  00000FFF  CH{0-11}WAITSTATUS:0
    0014   CHSWREQ       w  00000000  CH{0-11}SWREQ:0
    0018   CHUSEBURSTS   rw 00000000  CH{0-11}USEBURSTS:0
    001C   CHUSEBURSTC   w  00000000  CH{0-11}USEBURSTC:0
    0020   CHREQMASKS    rw 00000000  CH{0-11}REQMASKS:0
    0024   CHREQMASKC    w  00000000  CH{0-11}REQMASKC:0
    0028   CHENS         rw 00000000  CH{0-11}ENS:0
    002C   CHENC         w  00000000  CH{0-11}ENC:0
    0030   CHALTS        rw 00000000  CH{0-11}ALTS:0
    0034   CHALTC        w  00000000  CH{0-11}ALTC:0
    0038   CHPRIS        rw 00000000  CH{0-11}PRIS:0
    003C   CHPRIC        w  00000000  CH{0-11}PRIC:0
    004C   ERRORC        rw 00000000  ERRORC:0
    0E10   CHREQSTATUS   r  00000000  CH{0-11}REQSTATUS:0
    0E18   CHSREQSTATUS  r  00000000  CH{0-11}SREQSTATUS:0
    1000   IF            r  00000000  CH{0-11}DONE:0 ERR:31
    1004   IFS           w  00000000  CH{0-11}DONE:0 ERR:31
    1008   IFC           w  00000000  CH{0-11}DONE:0 ERR:31
    100C   IEN           rw 00000000  CH{0-11}DONE:0 ERR:31
    1010   CTRL          rw 00000000  DESCRECT:0 PRDU:1 - kept
    1014   RDS           rw 00000000  RDSCH{0-11}:0 - kept
    1020   LOOP0         rw 00000000  WIDTH:0:10 EN:16 - kept
    1024   LOOP1         rw 00000000  WIDTH:0:10 EN:16 - kept
    1060   RECT0         rw 00000000  HEIGHT:0:10 SRCSTRIDE:10:11 DSTSTRIDE:21:11 - kept
    1100/4 CH{0-11}_CTRL rw 00000000  SIGSEL:0:4 SOURCESEL:16:6
    """,
    Instance("DMA", 0x400C2000, {"DMA": 0}),
)
