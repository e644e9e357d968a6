"""Alternate functions of the EFM32GG280: the pins of each peripheral signal at each location.

EFM32GG280 data sheet, table of alternate functionality; a ROUTE register's LOCATION selects one.
"""

#: Each row is a signal and its pins, location 0 first.
_TABLE = """
    USART0_TX     PE10 PE7  PC11 PE13 PB7  PC0
    USART0_RX     PE11 PE6  PC10 PE12 PB8  PC1
    USART0_CLK    PE12 PE5  PC9  PC15 PB13 PB13
    USART0_CS     PE13 PE4  PC8  PC14 PB14 PB14
    USART1_TX     PC0  PD0  PD7
    USART1_RX     PC1  PD1  PD6
    USART1_CLK    PB7  PD2  PF0
    USART1_CS     PB8  PD3  PF1
    USART2_TX     PC2  PB3
    USART2_RX     PC3  PB4
    USART2_CLK    PC4  PB5
    USART2_CS     PC5  PB6
    UART0_TX      PF6  PE0  PA3  PC14
    UART0_RX      PF7  PE1  PA4  PC15
    UART1_TX      PC12 PF10 PB9  PE2
    UART1_RX      PC13 PF11 PB10 PE3
    LEUART0_TX    PD4  PB13 PE14 PF0  PF2
    LEUART0_RX    PD5  PB14 PE15 PF1  PA0
    LEUART1_TX    PC6  PA5
    LEUART1_RX    PC7  PA6
    I2C0_SDA      PA0  PD6  PC6  PD14 PC0  PF0  PE12
    I2C0_SCL      PA1  PD7  PC7  PD15 PC1  PF1  PE13
    I2C1_SDA      PC4  PB11 PE0
    I2C1_SCL      PC5  PB12 PE1
    TIMER0_CC0    PA0  PA0  PF6  PD1  PA0  PF0
    TIMER0_CC1    PA1  PA1  PF7  PD2  PC0  PF1
    TIMER0_CC2    PA2  PA2  PF8  PD3  PC1  PF2
    TIMER1_CC0    PC13 PE10 PB0  PB7  PD6
    TIMER1_CC1    PC14 PE11 PB1  PB8  PD7
    TIMER1_CC2    PC15 PE12 PB2  PB11 PC13
    TIMER2_CC0    PA8  PA12 PC8
    TIMER2_CC1    PA9  PA13 PC9
    TIMER2_CC2    PA10 PA14 PC10
    TIMER3_CC0    PE14 PE0
    TIMER3_CC1    PE15 PE1
    TIMER3_CC2    PA15 PE2
    LETIMER0_OUT0 PD6  PB11 PF0  PC4
    LETIMER0_OUT1 PD7  PB12 PF1  PC5
    PCNT0_S0IN    PC13 PE0  PC0  PD6
    PCNT0_S1IN    PC14 PE1  PC1  PD7
    PCNT1_S0IN    PC4  PB3
    PCNT1_S1IN    PC5  PB4
    PCNT2_S0IN    PD0  PE8
    PCNT2_S1IN    PD1  PE9
    ACMP0_OUT     PE13 PE2  PD6
    ACMP1_OUT     PF2  PE3  PD7
    PRS_CH0       PA0  PF3
    PRS_CH1       PA1  PF4
    PRS_CH2       PC0  PF5
    PRS_CH3       PC1  PE8
    CMU_CLK0      PA2  PC12 PD7
    CMU_CLK1      PA1  PD8  PE12
    DBG_SWO       PF2  PC15 PD1  PD2
    LESENSE_CH0   PC0
    LESENSE_CH1   PC1
    LESENSE_CH2   PC2
    LESENSE_CH3   PC3
    LESENSE_CH4   PC4
    LESENSE_CH5   PC5
    LESENSE_CH6   PC6
    LESENSE_CH7   PC7
    LESENSE_CH8   PC8
    LESENSE_CH9   PC9
    LESENSE_CH10  PC10
    LESENSE_CH11  PC11
    LESENSE_CH12  PC12
    LESENSE_CH13  PC13
    LESENSE_CH14  PC14
    LESENSE_CH15  PC15
    LESENSE_ALTEX0 PD6
    LESENSE_ALTEX1 PD7
    LESENSE_ALTEX2 PA3
    LESENSE_ALTEX3 PA4
    LESENSE_ALTEX4 PA5
    LESENSE_ALTEX5 PE11
    LESENSE_ALTEX6 PE12
    LESENSE_ALTEX7 PE13
"""

LOCATIONS = 8  #: range of a LOCATION field; no signal has as many pins


#: Names of all pins by number, port times 16 plus bit: ``PE10`` is 74.
PINS = tuple(f"P{port}{bit}" for port in "ABCDEF" for bit in range(16))


def pin_number(name: str) -> int:
    """The index of a name in ``PINS``; ValueError for other names."""
    if name not in PINS:
        raise ValueError(f"{name!r} is no pin, as PA0 or PE10 are")
    return PINS.index(name)


#: Pins of each signal by location, as ``port * 16 + bit``.
ROUTES: dict[str, tuple[int, ...]] = {
    signal: tuple(map(pin_number, pins))
    for signal, *pins in (line.split() for line in _TABLE.split("\n") if line.strip())
}

#: Serial blocks in the order of their unit numbers in messages and calls of the simulator.
SERIAL_UNITS = ("USART0", "USART1", "USART2", "UART0", "UART1", "LEUART0", "LEUART1")


def serial_locations(unit: str) -> tuple[tuple[int, int], ...]:
    """The pairs of TX and RX pin of a block of ``SERIAL_UNITS``, location 0 first."""
    return tuple(zip(ROUTES[f"{unit}_TX"], ROUTES[f"{unit}_RX"], strict=True))
