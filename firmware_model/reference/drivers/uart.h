/* The satellite's UART: 8N1, by interrupt.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef UART_H
#define UART_H

#include <stdint.h>

#define UART_SEND_BYTES 2048

void uart_start(void);

/* Queues bytes, which must have room (`uart_backlog`). */
void uart_send(const uint8_t *data, int count);

/* Bytes that are still to be sent, those in the peripheral included. */
int uart_backlog(void);

/* Given by the program, called by interrupts: a byte came; nothing came for long. */
void uart_received(uint8_t byte);
void uart_silent(void);

#endif
