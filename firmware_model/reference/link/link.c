/* SPDX-License-Identifier: BSD-2-Clause */
/* The node's link to the satellite. */
#include "link.h"

#include "drivers/clock.h"
#include "drivers/i2c_slave.h"
#include "drivers/uart.h"
#include "frames.h"
#include "queue.h"
#include "state.h"
#include "telemetry.h"

#define TELEMETRY_BIT 0x80
#define NO_DATA 0xFF /* beyond the end of a message, or without one */

/* Flags for messages on one bus. */
struct bus_flags {
    uint8_t overflow, too_few, too_many;
};

static const struct bus_flags uart_flags = {
    FLAG_UART_TcmdBufOfError, FLAG_UART_Tcmd_TooFewParm, FLAG_UART_Tcmd_TooManyParm};
static const struct bus_flags i2c_flags = {
    FLAG_I2C_TcmdBufOFError, FLAG_I2C_TCMD_TooFewParm, FLAG_I2C_TCMD_TooManyparm};

static struct frame_decoder decoder;
static uint8_t frame[LONGEST_FRAME];

static struct {
    bool addressed, reading, answered; /* answered: there is an answer, which may be empty */
    int written, length, position;
    uint8_t message[LONGEST_TELECOMMAND + 1];
    uint8_t answer[LONGEST_TELEMETRY];
} i2c;

bool link_idle(void)
{
    return !frame_unfinished(&decoder) && !i2c.addressed && !queue_waiting() && !uart_backlog();
}

/* --- both buses ------------------------------------------------------------------------------- */

/* Writes the answer to `data` and returns its length; -1 without one. */
static int read_telemetry(uint8_t id, uint8_t *data)
{
    const struct telemetry *message = telemetry_of(id);
    if (!message) {
        raise_flag(FLAG_TlmIDError);
        return -1;
    }
    memset(data, 0, message->length);
    telemetry_fill(message, data);
    retained.telemetry++;
    return message->length;
}

/* The switches are those of the published program: other values are rejected. */
static bool switches_allowed(uint8_t id, const uint8_t *parameters)
{
    if (id == CUBESTAR_TC_SetProfile)
        return parameters[0] == published_profile[0];
    if (id == CUBESTAR_TC_SetSwitch)
        return parameters[1] == published_profile[1 + parameters[0]];
    return true;
}

/* Queues a telecommand, or returns its error. */
static uint8_t checked(uint8_t id, const uint8_t *parameters, int length,
                       const struct bus_flags *flags)
{
    const struct telecommand *command = telecommand_of(id);
    if (!command) {
        raise_flag(FLAG_TcmdIDError);
        return CUBESTAR_ACK_ERROR_INVALID_ID;
    }
    if (length != command->length) {
        raise_flag(length < command->length ? flags->too_few : flags->too_many);
        return CUBESTAR_ACK_ERROR_WRONG_LENGTH;
    }
    if (!parameters_allowed(command, parameters, raise_flag)) {
        if (command->task.failed)
            task_status = command->task.failed;
        return CUBESTAR_ACK_ERROR_BAD_PARAMETER;
    }
    if (!switches_allowed(id, parameters))
        return CUBESTAR_ACK_ERROR_BAD_PARAMETER;
    if (!queue_put(command, parameters)) {
        raise_flag(flags->overflow);
        return CUBESTAR_ACK_ERROR_BUFFER_FULL;
    }
    retained.telecommands++;
    wake();
    return CUBESTAR_ACK_ERROR_OK;
}

/* --- UART ------------------------------------------------------------------------------------- */

/* Answers if the buffer has room. */
static void send(const uint8_t *payload, int length)
{
    int count = frame_encode(frame, payload, length);
    if (uart_backlog() + count <= UART_SEND_BYTES)
        uart_send(frame, count);
}

static void uart_message(const uint8_t *payload, int length)
{
    static uint8_t answer[LONGEST_TELEMETRY];
    if (!length) {
        raise_flag(FLAG_UART_ProtocolError);
    } else if (payload[0] & TELEMETRY_BIT) {
        int count = read_telemetry(payload[0], answer);
        if (count >= 0)
            send(answer, count);
    } else {
        uint8_t error = checked(payload[0], payload + 1, length - 1, &uart_flags);
        send(&error, 1);
    }
    state_retain();
}

void uart_received(uint8_t byte)
{
    switch (frame_feed(&decoder, byte)) {
    case FRAME_WHOLE: /* the kept front of a long one is too long too */
        uart_message(decoder.payload, decoder.length);
        break;
    case FRAME_INCOMPLETE:
        raise_flag(FLAG_UART_MsgIncomplete);
        break;
    case FRAME_PROTOCOL_ERROR:
        raise_flag(FLAG_UART_ProtocolError);
        break;
    case FRAME_NOTHING:
        break;
    }
}

void uart_silent(void)
{
    if (frame_reset(&decoder)) {
        raise_flag(FLAG_UART_MsgIncomplete);
        raise_flag(FLAG_UART_RXTimeout);
    }
}

/* --- I2C -------------------------------------------------------------------------------------- */

/* Processes the message that a stop or a repeated start ended. */
static void finish_write(void)
{
    if (!i2c.written)
        return;
    if (i2c.message[0] & TELEMETRY_BIT) {
        int count = read_telemetry(i2c.message[0], i2c.answer);
        i2c.answered = true; /* one rejected with a flag counts as an empty answer */
        i2c.length = count < 0 ? 0 : count;
        i2c.position = 0;
    } else {
        checked(i2c.message[0], i2c.message + 1, i2c.written - 1, &i2c_flags);
    }
    i2c.written = 0;
    state_retain();
}

void i2c_slave_started(bool read)
{
    finish_write();
    i2c.addressed = true;
    i2c.reading = read;
    if (read && !i2c.answered)
        raise_flag(FLAG_I2C_WaitForIDReadRequestError);
}

bool i2c_slave_received(uint8_t byte)
{
    if (i2c.written > LONGEST_TELECOMMAND)
        return false;
    i2c.message[i2c.written++] = byte;
    return true;
}

uint8_t i2c_slave_wanted(void)
{
    int position = i2c.position++;
    return i2c.answered && position < i2c.length ? i2c.answer[position] : NO_DATA;
}

void i2c_slave_stopped(void)
{
    finish_write();
    if (i2c.reading)
        i2c.answered = false;
    i2c.addressed = i2c.reading = false;
}
