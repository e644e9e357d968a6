/* SPDX-License-Identifier: BSD-2-Clause */
/* Look-up, checks and packing with the generated tables.
 *
 * Rounding and saturation are those of firmware_model/interface/codec/field.py. */
#include "cubestar_tables.h"

static double limited(double value, double low, double high)
{
    if (value != value)
        return 0;
    return value < low ? low : value > high ? high : value;
}

/* Rounds halves away from zero. */
static int64_t nearest(double value)
{
    double magnitude = value < 0 ? -value : value;
    int64_t whole = (int64_t)magnitude;
    whole += magnitude - (double)whole >= 0.5;
    return value < 0 ? -whole : whole;
}

void put(uint8_t *data, struct field field, double value)
{
    unsigned offset = field.bit / 8;
    double counts = value * field.scale;
    switch (field.type) {
    case FIELD_BOOL1:
        data[offset] |= (uint8_t)(nearest(limited(counts, 0, 1)) << field.bit % 8);
        break;
    case FIELD_U8:
        cubestar_put_u8(data, offset, (uint8_t)nearest(limited(counts, 0, UINT8_MAX)));
        break;
    case FIELD_U16:
        cubestar_put_u16(data, offset, (uint16_t)nearest(limited(counts, 0, UINT16_MAX)));
        break;
    case FIELD_I16:
        cubestar_put_i16(data, offset, (int16_t)nearest(limited(counts, INT16_MIN, INT16_MAX)));
        break;
    case FIELD_U32:
        cubestar_put_u32(data, offset, (uint32_t)nearest(limited(counts, 0, UINT32_MAX)));
        break;
    case FIELD_F32:
        cubestar_put_f32(data, offset, (float)value);
        break;
    }
}

const struct telecommand *telecommand_of(uint8_t id)
{
    for (int i = 0; i < TELECOMMANDS; i++)
        if (telecommands[i].id == id)
            return &telecommands[i];
    return NULL;
}

const struct telemetry *telemetry_of(uint8_t id)
{
    for (int i = 0; i < TELEMETRIES; i++)
        if (telemetries[i].id == id)
            return &telemetries[i];
    return NULL;
}

static unsigned number(const uint8_t *parameters, unsigned offset, bool two_bytes)
{
    return two_bytes ? cubestar_get_u16(parameters, offset) : parameters[offset];
}

static bool kept(const struct rule *rule, const uint8_t *parameters)
{
    bool two_bytes = rule->kind == RULE_U16 || rule->kind == RULE_ORDER_U16;
    if (rule->kind == RULE_F32) {
        float value = cubestar_get_f32(parameters, rule->offset);
        return isfinite(value) && rule->within.f32.low <= value && value <= rule->within.f32.high;
    }
    unsigned value = number(parameters, rule->offset, two_bytes);
    if (rule->kind == RULE_ORDER_U8 || rule->kind == RULE_ORDER_U16)
        return value <= number(parameters, rule->other, two_bytes);
    unsigned other = parameters[rule->other];
    if (other < rule->low || other > rule->high)
        return true;
    for (int i = 0; i < rule->within.list.count; i++) {
        const struct range *range = &rule->within.list.ranges[i];
        if (range->low <= value && value <= range->high)
            return true;
    }
    return false;
}

bool parameters_allowed(const struct telecommand *command, const uint8_t *parameters,
                        void (*violated)(uint8_t flag))
{
    bool allowed = true;
    for (int i = 0; i < command->rules; i++) {
        const struct rule *rule = &telecommand_rules[command->first_rule + i];
        if (!kept(rule, parameters)) {
            violated(rule->flag);
            allowed = false;
        }
    }
    return allowed;
}
