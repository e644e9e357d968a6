/* SPDX-License-Identifier: BSD-2-Clause */
/* Image capture as in firmware_model/cubestar/capture.py (getImage of the thesis). */
#include "capture.h"

#include <stddef.h>

#include "drivers/clock.h"
#include "drivers/fpga.h"
#include "drivers/reset.h"
#include "image_sensor.h"
#include "state.h"
#include "supply_monitor.h"

#define ACK_TIMEOUT_US 2000000u
#define POLL_US 10u
#define TRANSFER_PIECE 4096 /* bytes; the watchdog is fed after each */

/* Starts the sensor and waits for its first, invalid frame (imagerEnable). */
static uint8_t enable_sensor(void)
{
    uint8_t failure = sensor_configure();
    if (failure != NO_FLAG)
        return failure;
    task_status = CUBESTAR_TASK_STATUS_CAPTURING;
    if (!sensor_enable(true))
        return FLAG_ISEnableError;
    retained.idle_us = retained.idling_us;
    retained.idling_us = 0;
    uint64_t enabled = time_us();
    sleep_until(enabled + 1000u * SETTING(u16, SetDiscardDelay, Delay), false);
    retained.discard_us = since(enabled);
    return NO_FLAG;
}

/* Polls ACK; the resolution of an image's time is POLL_US. */
static bool await_acknowledge(void)
{
    uint64_t started = time_us();
    while (!fpga_acknowledges()) {
        if (since(started) >= ACK_TIMEOUT_US)
            return false;
        watchdog_feed();
        spin_us(POLL_US);
    }
    return true;
}

/* Lets the FPGA store a frame (fpgaWriteToRam). */
static uint8_t store_frame(bool (*meanwhile)(void))
{
    uint64_t started = time_us();
    fpga_bank(SETTING(u8, SelectImageBank, Bank));
    fpga_read_not_write(false);
    fpga_enable(true);
    supply_sample();
    if (meanwhile)
        meanwhile();
    bool stored = await_acknowledge();
    fpga_enable(false);
    retained.capture_us = since(started);
    retained.image_ms = (uint32_t)((time_us() - sensor_age_at_frame_end_us()) / 1000u);
    if (!sensor_enable(false)) {
        raise_flag(FLAG_ISDisableError); /* the image is valid nevertheless */
        sensor_forget_set_up();
    }
    return stored ? NO_FLAG : FLAG_ImageCaptureError;
}

/* Copies the stored frame into the external RAM (imageTransfer). */
static void fetch(void)
{
    uint64_t started = time_us();
    fpga_read_not_write(true);
    fpga_enable(true);
    supply_sample();
    for (int done = 0; done < PICTURE_BYTES; done += TRANSFER_PIECE) {
        fpga_transfer(PICTURE + done, TRANSFER_PIECE);
        watchdog_feed();
    }
    fpga_enable(false);
    fpga_read_not_write(false);
    retained.transfer_us = since(started);
}

bool capture_image(bool (*meanwhile)(void))
{
    uint8_t failure = enable_sensor();
    if (failure == NO_FLAG)
        failure = store_frame(meanwhile);
    else if (meanwhile)
        meanwhile();
    if (failure == NO_FLAG) {
        fetch();
        if (supply_cut()) /* during the transfer */
            failure = FLAG_ImageCaptureError;
    }
    if (failure != NO_FLAG) {
        raise_flag(failure);
        sensor_forget_set_up();
        retained.image_present = 0;
        task_status = CUBESTAR_TASK_STATUS_CAPTURE_FAILED;
        return false;
    }
    retained.image_present = 1;
    retained.frame++;
    task_status = CUBESTAR_TASK_STATUS_CAPTURED;
    return true;
}

bool capture_replaced(void)
{
    retained.image_ms = (uint32_t)(time_us() / 1000u);
    retained.image_present = !supply_cut();
    retained.frame++;
    return !supply_cut();
}
