/* SPDX-License-Identifier: BSD-2-Clause */
/* CubeStar's main program: telecommands, and the 1 Hz pipeline.
 *
 * CubeStar thesis, section 5.3.6 and figure 5.8: while the FPGA stores a new image, the processor
 * works on the previous one; then the image is transferred, and a software reset ends the
 * iteration. As firmware_model/cubestar/program.py. */
#include "imaging/capture.h"
#include "link/commands.h"
#include "core.h"
#include "drivers/camera_bus.h"
#include "drivers/clock.h"
#include "drivers/memories.h"
#include "drivers/fpga.h"
#include "drivers/gpio.h"
#include "drivers/i2c_slave.h"
#include "drivers/reset.h"
#include "drivers/uart.h"
#include "imaging/image_sensor.h"
#include "link/link.h"
#include "pins.h"
#include "imaging/processing.h"
#include "link/queue.h"
#include "state.h"
#include "supply_monitor.h"

#define ITERATION_US 1000000u
#define RESET_LEAD_US 5000u  /* from the reset, which takes a third of it, to the next iteration */
#define LATE_US 10000u       /* an iteration that is later is a timing error */

static void reset(void)
{
    interrupts_off();
    retained.reset_us = time_us();
    timer_retain();
    state_retain();
    reset_processor();
}

/* Restores a supply and executes a waiting telecommand; false if there was neither. */
static bool serve(void)
{
    timer_retain();
    state_retain();
    supply_sample();
    bool waiting = supply_cut() || queue_waiting();
    if (supply_cut() && supply_restore())
        sensor_power_up();
    if (queue_waiting()) {
        static struct queued_command command;
        command = *queue_first();
        command_running = true;
        queue_taken();
        bool ends = command_execute(&command);
        if (ends) {
            while (uart_backlog()) /* the acknowledge */
                watchdog_feed();
            reset();
        }
        command_running = false;
    }
    return waiting;
}

static void idle(uint64_t due_us)
{
    uint64_t started = time_us();
    sleep_until(due_us, true);
    retained.idling_us += since(started);
}

/* Idles until `due_us` and serves the host and the supplies meanwhile. Returns at once if the loop
 * is stopped. Telecommands precede the next iteration. */
static void wait_until(uint64_t due_us)
{
    while (retained.looping) {
        bool served = serve();
        if (time_us() >= due_us && !queue_waiting())
            return;
        if (!served)
            idle(due_us);
    }
}

/* One turn of the loop; it starts at the end of the last one's second. */
static void iterate(void)
{
    wait_until(retained.loop_due_us);
    if (!retained.looping)
        return;
    uint64_t started = time_us();
    if (started > retained.loop_due_us + LATE_US) {
        raise_flag(FLAG_TimingError);
        retained.loop_due_us = started;
    }
    retained.loop_due_us += ITERATION_US;
    retained.delaying = 0;
    capture_image(retained.image_present ? process : NULL);
    retained.iterations++;
    retained.loop_us = since(started);
    if (retained.loop_us > retained.longest_loop_us)
        retained.longest_loop_us = retained.loop_us;
    wait_until(retained.loop_due_us - RESET_LEAD_US);
    uint32_t masked = interrupts_off();
    if (retained.looping && link_idle())
        reset();
    interrupts_restore(masked);
}

static void start(void)
{
    watchdog_start();
    state_restore();
    timer_start();
    fpga_start();
    supply_start(retained.cut | retained.imager_off << CHANNEL_IMAGER);
    external_ram_start();
    camera_bus_start();
    uart_start();
    i2c_slave_start();
    pin_set_up(CAMERA_RESET, PIN_OUTPUT, 1);
    pin_set_up(LED0, PIN_OUTPUT, 1);
    pin_set_up(LED1, PIN_OUTPUT, 1);
}

int main(void)
{
    start();
    task_status = CUBESTAR_TASK_STATUS_POWERED_UP;
    startup_us = since(retained.reset_us);
    retained.idling_us += startup_us;
    reset_cause = reset_cause_taken();
    if (reset_cause == CUBESTAR_RESET_CAUSE_WATCHDOG ||
        reset_cause == CUBESTAR_RESET_CAUSE_EXTERNAL_OR_WATCHDOG)
        retained.watchdog_resets++;
    if (reset_cause != CUBESTAR_RESET_CAUSE_SYSTEM_REQUEST || !retained.camera_setup)
        sensor_power_up();
    for (;;) {
        bool served = serve();
        if (retained.looping)
            iterate();
        else if (!served)
            idle(FOR_EVER);
    }
}
