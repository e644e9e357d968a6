/* SPDX-License-Identifier: BSD-2-Clause */
/* The image sensor's set-up, as in firmware_model/cubestar/image_sensor.py. */
#include "image_sensor.h"

#include "drivers/camera_bus.h"
#include "drivers/clock.h"
#include "state.h"

#define SETTLE_US 2000u
#define LONGEST_REGISTER 32

#define REST (1u << CAMERA_MODE_SELECT_OUTPUT_DEPTH)
#define GATHER (REST | 1u << CAMERA_MODE_SELECT_ENABLE)
#define ALL_BUT_SHARPENING                                                                         \
    (1u << CAMERA_HARDWARE_FEATURES_DEFECT_CORRECTION |                                            \
     1u << CAMERA_HARDWARE_FEATURES_FPN_CORRECTION |                                               \
     1u << CAMERA_HARDWARE_FEATURES_DARK_SUBTRACTION |                                             \
     1u << CAMERA_HARDWARE_FEATURES_HISTOGRAM_REMAP)
#define AUTOVIEW_ONLY (1u << CAMERA_FIRMWARE_FEATURES_AUTOVIEW)

uint16_t selected_address;
uint8_t selected_value;
bool selected_valid;

/* Registers take the high byte first. */
static bool write(uint16_t address, int width, uint32_t value)
{
    uint8_t message[2 + LONGEST_REGISTER] = {(uint8_t)(address >> 8), (uint8_t)address};
    for (int i = 0; i < width && i < 4; i++)
        message[2 + width - 1 - i] = (uint8_t)(value >> 8 * i);
    return camera_bus_write(message, 2 + width);
}

void sensor_power_up(void)
{
    pause_us(SETTLE_US);
    retained.camera_setup = 0;
}

void sensor_forget_set_up(void)
{
    retained.camera_setup = 0;
}

static uint8_t failed(uint8_t flag)
{
    task_status = CUBESTAR_TASK_STATUS_CAMERA_FAILED;
    return flag;
}

uint8_t sensor_configure(void)
{
    uint16_t rate = SETTING(u16, SetFrameRate, FrameRate);
    uint16_t exposure = SETTING(u16, Exposure, exposure);
    uint32_t wanted = (uint32_t)rate << 16 | exposure;
    if (retained.camera_setup == wanted)
        return NO_FLAG;
    uint8_t flag = retained.camera_setup ? FLAG_ConfigChangeError : FLAG_ISSetupError;
    retained.camera_setup = 0; /* until all registers are written */
    task_status = CUBESTAR_TASK_STATUS_CAMERA_INITIALISING;
    uint64_t started = time_us();
    if (!write(CAMERA_MODE_SELECT, REST) || !write(CAMERA_HARDWARE_FEATURES, ALL_BUT_SHARPENING) ||
        !write(CAMERA_LINEARITY, 0) || !write(CAMERA_FRAMES_PER_SECOND, rate) ||
        !write(CAMERA_FIRMWARE_FEATURES, AUTOVIEW_ONLY))
        return failed(flag);
    task_status = CUBESTAR_TASK_STATUS_CAMERA_INITIALISED;
    uint64_t exposing = time_us();
    if (!write(CAMERA_EXPOSURE_RULE, exposure ? 0 : CAMERA_LONGEST_EXPOSURE) ||
        !write(CAMERA_EXPOSURE, exposure) || !write(CAMERA_SYNC, CAMERA_SYNC_APPLY))
        return failed(flag);
    retained.exposure_setup_us = since(exposing);
    retained.camera_setup_us = since(started);
    retained.camera_setup = wanted;
    return NO_FLAG;
}

bool sensor_apply_settings(void)
{
    uint8_t flag = sensor_configure();
    raise_flag(flag);
    return flag == NO_FLAG;
}

bool sensor_enable(bool on)
{
    return write(CAMERA_MODE_SELECT, on ? GATHER : REST);
}

void sensor_write_byte(uint16_t address, uint8_t value)
{
    if (!write(address, 1, value))
        raise_flag(FLAG_ConfigChangeError);
}

void sensor_select_register(uint16_t address)
{
    const uint8_t head[2] = {(uint8_t)(address >> 8), (uint8_t)address};
    uint8_t value = 0;
    bool answered = camera_bus_read(head, sizeof head, &value);
    selected_address = address;
    selected_value = answered ? value : 0;
    selected_valid = answered;
    if (!answered)
        raise_flag(FLAG_ISSetupError);
}

/* The sensor shortens an exposure that does not fit the frame. */
uint32_t sensor_age_at_frame_end_us(void)
{
    uint32_t rate = SETTING(u16, SetFrameRate, FrameRate);
    uint32_t exposure = SETTING(u16, Exposure, exposure), clocks = rate * CAMERA_LINE_CLOCKS;
    uint32_t longest = (CAMERA_CLOCKS_PER_SECOND_RESET + clocks / 2) / clocks - 1;
    uint32_t lines = exposure && exposure < longest ? exposure : longest;
    uint64_t half_lines = CAMERA_ROWS + lines;
    return (uint32_t)(half_lines * CAMERA_LINE_CLOCKS * 1000000u / CAMERA_CRYSTAL_HZ / 2);
}
