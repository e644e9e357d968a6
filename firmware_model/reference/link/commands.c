/* SPDX-License-Identifier: BSD-2-Clause */
/* Telecommands, as in firmware_model/cubestar/commands.py.
 *
 * A setting telecommand stores its parameters. Others act at once, or take time; a few end in a
 * reset, which discards waiting telecommands. */
#include "commands.h"

#include "imaging/capture.h"
#include "core.h"
#include "drivers/clock.h"
#include "drivers/uart.h"
#include "drivers/reset.h"
#include "link/frames.h"
#include "imaging/image_sensor.h"
#include "imaging/processing.h"
#include "state.h"
#include "supply_monitor.h"

#define UPLOAD_BLOCK_BYTES CUBESTAR_TC_UploadBlock_Data_SIZE
#define STREAM_BACKLOG_BYTES 512
#define STREAM_PAUSE_US 20000u
#define PATTERN_FACTOR 167u /* of the memory test: differs between rows */
#define FED_EVERY 0x10000u

volatile bool command_running;
uint8_t memory_test = CUBESTAR_MEMORY_TEST_NOT_RUN;
uint16_t next_block, blocks_received;
bool second_half;

/* --- node ------------------------------------------------------------------------------------- */

static void toggle_supply(void)
{
    if (supply_toggle_imager()) {
        sensor_power_up();
        sensor_apply_settings();
    }
}

static void forget_all(void)
{
    if (retained.imager_off)
        supply_toggle_imager();
    state_forget();
}

/* Hangs until the watchdog resets; interrupts are still served. */
static void hang(void)
{
    for (;;)
        ;
}

static uint8_t pattern(unsigned address)
{
    return (uint8_t)(address * PATTERN_FACTOR >> 3);
}

/* Writes a pattern and reads it back, then its complement; the image is lost. */
static void test_memory(void)
{
    volatile uint8_t *memory = EXTERNAL_MEMORY;
    retained.image_present = 0;
    bool passed = true;
    for (unsigned flip = 0; flip <= 0xFF; flip += 0xFF) {
        for (unsigned i = 0; i < EXTERNAL_RAM_BYTES; i++) {
            memory[i] = (uint8_t)(pattern(i) ^ flip);
            if (i % FED_EVERY == 0)
                watchdog_feed();
        }
        for (unsigned i = 0; i < EXTERNAL_RAM_BYTES; i++) {
            passed &= memory[i] == (uint8_t)(pattern(i) ^ flip);
            if (i % FED_EVERY == 0)
                watchdog_feed();
        }
    }
    memory_test = passed ? CUBESTAR_MEMORY_TEST_PASSED : CUBESTAR_MEMORY_TEST_FAILED;
}

/* Address of an image sensor register in the selected page. */
static uint16_t paged(const uint8_t *parameters)
{
    return (uint16_t)(SETTING(u8, SetCameraRegisterPage, Page) << 8 | parameters[0]);
}

/* --- image ------------------------------------------------------------------------------------ */

static bool test_pattern(uint8_t kind)
{
    for (unsigned row = 0; row < PICTURE_ROWS; row++) {
        unsigned first = kind == CUBESTAR_TEST_PATTERN_MOVING  ? retained.frame
                         : kind == CUBESTAR_TEST_PATTERN_FIXED ? row
                                                               : 0;
        for (unsigned column = 0; column < PICTURE_COLUMNS; column++)
            PICTURE[row * PICTURE_COLUMNS + column] = (uint8_t)(first + column);
        watchdog_feed();
    }
    return capture_replaced();
}

static bool begin_upload(void)
{
    next_block = blocks_received = 0;
    memset(PICTURE, 0, PICTURE_BYTES);
    return capture_replaced();
}

static bool upload_block(const uint8_t *parameters)
{
    uint16_t number = cubestar_get_u16(parameters, CUBESTAR_TC_UploadBlock_BlockNumber_OFFSET);
    memcpy(PICTURE + number * UPLOAD_BLOCK_BYTES,
           parameters + CUBESTAR_TC_UploadBlock_Data_OFFSET, UPLOAD_BLOCK_BYTES);
    next_block = (uint16_t)(number + 1);
    blocks_received++;
    return retained.image_present; /* false: no upload has begun, or it was lost */
}

static void stream_image(void)
{
    static uint8_t frame[LONGEST_FRAME];
    for (unsigned start = 0; start < PICTURE_BYTES; start += UPLOAD_BLOCK_BYTES) {
        while (uart_backlog() > STREAM_BACKLOG_BYTES)
            pause_us(STREAM_PAUSE_US);
        uart_send(frame, frame_encode(frame, PICTURE + start, UPLOAD_BLOCK_BYTES));
    }
}

/* --- stars and loop --------------------------------------------------------------------------- */

static void set_hint(void)
{
    retained.hint_present = 1;
    set_mode(CUBESTAR_MATCH_MODE_ASSISTED);
}

static void trigger(void)
{
    if (retained.looping) {
        raise_flag(retained.delaying ? FLAG_TimerAlreadyRunning : FLAG_TriggerAlreadySet);
        return;
    }
    retained.loop_due_us = time_us() + 10000u * SETTING(u8, setDelayTimerTimeout, Time);
    retained.looping = retained.delaying = 1;
}

/* --- dispatch --------------------------------------------------------------------------------- */

/* False: the task failed. */
static bool act(uint8_t id, const uint8_t *parameters)
{
    switch (id) {
    case CUBESTAR_TC_TogglePowerSW:
        toggle_supply();
        break;
    case CUBESTAR_TC_ClearWDGResetCounter:
        retained.watchdog_resets = 0;
        break;
    case CUBESTAR_TC_ClearErrorFlags:
        clear_flags();
        break;
    case CUBESTAR_TC_Reset:
        forget_all();
        break;
    case CUBESTAR_TC_TestWDG:
        hang();
        break;
    case CUBESTAR_TC_TestSRAM:
        test_memory();
        break;
    case CUBESTAR_TC_ReadConfig:
        load_config();
        break;
    case CUBESTAR_TC_SaveConfig:
        save_config();
        break;
    case CUBESTAR_TC_ClearConfig:
        erase_config();
        break;
    case CUBESTAR_TC_Exposure:
        return sensor_apply_settings();
    case CUBESTAR_TC_ImageBlockSet:
        second_half = false;
        break;
    case CUBESTAR_TC_WriteTo_IS_Register:
        sensor_write_byte(paged(parameters),
                          parameters[CUBESTAR_TC_WriteTo_IS_Register_DataL_OFFSET]);
        break;
    case CUBESTAR_TC_ReadFrom_IS_Register:
        sensor_select_register(paged(parameters));
        break;
    case CUBESTAR_TC_WriteCameraRegister:
        sensor_write_byte(
            cubestar_get_u16(parameters, CUBESTAR_TC_WriteCameraRegister_Address_OFFSET),
            parameters[CUBESTAR_TC_WriteCameraRegister_Value_OFFSET]);
        break;
    case CUBESTAR_TC_SelectCameraRegister:
        sensor_select_register(cubestar_get_u16(parameters, 0));
        break;
    case CUBESTAR_TC_CaptureTestPatern:
        return test_pattern(parameters[0]);
    case CUBESTAR_TC_CaptureImage:
        return capture_image(NULL);
    case CUBESTAR_TC_UploadImage:
        return begin_upload();
    case CUBESTAR_TC_UploadBlock:
        return upload_block(parameters);
    case CUBESTAR_TC_StreamDownImage:
        stream_image();
        break;
    case CUBESTAR_TC_DetectStars:
        return detect();
    case CUBESTAR_TC_setIDMode:
        if (parameters[0] == CUBESTAR_ID_MODE_LOST_IN_SPACE)
            set_mode(CUBESTAR_MATCH_MODE_LOST_IN_SPACE);
        break;
    case CUBESTAR_TC_setTrackingMode:
        set_hint();
        break;
    case CUBESTAR_TC_IDStars:
        return identify_stars();
    case CUBESTAR_TC_SelectBestStars:
        return select_best();
    case CUBESTAR_TC_EstimateAttitude:
        return estimate();
    case CUBESTAR_TC_CaptureAndProcess:
        capture_and_process();
        break;
    case CUBESTAR_TC_ProcessImage:
        return process();
    case CUBESTAR_TC_Trigger:
        trigger();
        break;
    case CUBESTAR_TC_StopLoop:
        retained.looping = retained.delaying = 0;
        break;
    }
    return true;
}

bool command_execute(const struct queued_command *queued)
{
    const struct telecommand *command = queued->command;
    if (command->setting >= 0) {
        uint32_t masked = interrupts_off();
        memcpy(retained.settings + command->setting, queued->parameters, command->length);
        interrupts_restore(masked);
    }
    if (command->task.begun)
        task_status = command->task.begun;
    bool good = act(command->id, queued->parameters);
    if (command->task.begun)
        task_status = good || !command->task.failed ? command->task.done : command->task.failed;
    return command->id == CUBESTAR_TC_Reset || command->id == CUBESTAR_TC_MCUReset;
}
