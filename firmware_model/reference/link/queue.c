/* SPDX-License-Identifier: BSD-2-Clause */
/* Waiting telecommands, in a ring. */
#include "queue.h"

static struct queued_command queue[QUEUE_DEPTH];
static volatile unsigned put_count, taken_count;

bool queue_waiting(void)
{
    return put_count != taken_count;
}

const struct queued_command *queue_first(void)
{
    return &queue[taken_count % QUEUE_DEPTH];
}

void queue_taken(void)
{
    taken_count++;
}

bool queue_put(const struct telecommand *command, const uint8_t *parameters)
{
    if (put_count - taken_count == QUEUE_DEPTH)
        return false;
    struct queued_command *place = &queue[put_count % QUEUE_DEPTH];
    place->command = command;
    memcpy(place->parameters, parameters, command->length);
    put_count++;
    return true;
}
