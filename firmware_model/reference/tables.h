/* SPDX-License-Identifier: BSD-2-Clause */
/* Elements of the generated tables: fields of telemetry, rules of telecommands. */
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

enum field_type { FIELD_BOOL1, FIELD_U8, FIELD_U16, FIELD_I16, FIELD_U32, FIELD_F32 };

/* A field of a message; its value is raw / scale. */
struct field {
    uint16_t bit;
    uint8_t type;
    double scale;
};

/* Writes a value into a message that is zero there: rounded to the nearest count, halves away from
 * zero, and saturated; not-a-number is 0 in an integer. */
void put(uint8_t *data, struct field field, double value);

/* The same, by the names in the interface, into `data`. */
#define PUT(message, name, value) put(data, F_##message##_##name, value)

#define NO_FLAG 255

/* Condition on a parameter, if the byte at `other` is within `low` and `high`. The two orders
 * require that the one at `offset` does not exceed the one at `other`. */
enum rule_kind { RULE_U8, RULE_U16, RULE_F32, RULE_ORDER_U8, RULE_ORDER_U16 };

struct range {
    uint16_t low, high;
};

struct rule {
    uint8_t kind, offset, other, low, high;
    uint8_t flag; /* raised on a violation, or NO_FLAG */
    union {
        struct {
            const struct range *ranges;
            int count;
        } list;
        struct {
            float low, high;
        } f32;
    } within;
};

/* States of telemetry TaskStatus; 0: none. */
struct task {
    uint8_t begun, done, failed;
};

struct telecommand {
    uint8_t id, length;
    int16_t setting; /* place of its parameters in the settings; -1: not stored */
    uint8_t first_rule, rules;
    struct task task;
};

struct telemetry {
    uint8_t id, length;
};

/* A setting in telemetry: `size` bytes. */
struct setting_shown {
    uint8_t id, to, from, size;
};

/* A step's latest or longest time in telemetry, u16 in ms. */
struct time_shown {
    uint8_t id, to, step, longest;
};

extern const uint8_t settings_reset[];
extern const struct rule telecommand_rules[];
extern const struct telecommand telecommands[];
extern const struct telemetry telemetries[];
extern const struct setting_shown settings_shown[];
extern const struct time_shown times_shown[];
extern const uint8_t published_profile[]; /* telemetry Profile of the switches that run here */

/* NULL for an unknown ID. */
const struct telecommand *telecommand_of(uint8_t id);
const struct telemetry *telemetry_of(uint8_t id);

/* Checks parameters; calls `violated` with the flag of each broken rule. True: none is broken. */
bool parameters_allowed(const struct telecommand *command, const uint8_t *parameters,
                        void (*violated)(uint8_t flag));
