/* SPDX-License-Identifier: BSD-2-Clause */
/* The satellite's UART: 8N1, by interrupt. */
#pragma once

#include <stdint.h>

#define UART_SEND_BYTES 2048

void uart_start(void);

/* Queues bytes; there must be room for them (`uart_backlog`). */
void uart_send(const uint8_t *data, int count);

/* Number of bytes still to send, including those in the peripheral. */
int uart_backlog(void);

/* Implemented by the program, called by interrupts: a byte was received; a long silence. */
void uart_received(uint8_t byte);
void uart_silent(void);
