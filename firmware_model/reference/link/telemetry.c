/* SPDX-License-Identifier: BSD-2-Clause */
/* Values of every telemetry frame, as in firmware_model/cubestar/telemetry.py. */
#include "telemetry.h"

#include "algorithms/geometry.h"
#include "algorithms/quest.h"
#include "imaging/capture.h"
#include "commands.h"
#include "drivers/clock.h"
#include "imaging/image_sensor.h"
#include "phases.h"
#include "imaging/processing.h"
#include "link/queue.h"
#include "imaging/star_reports.h"
#include "state.h"
#include "supply_monitor.h"

#define PROCESSING_LIMIT_US 500000u
#define BLOCK_BYTES CUBESTAR_TLM_ImageBlock_Block_SIZE

static double ms(uint32_t us)
{
    return us / 1000.0;
}

/* --- node ------------------------------------------------------------------------------------- */

static void identification(uint8_t *data)
{
    uint64_t now_ms = time_us() / 1000u;
    PUT(Identification, NodeType, NODE_TYPE);
    PUT(Identification, InterfaceVersion, CUBESTAR_INTERFACE_VERSION);
    PUT(Identification, FirmwareVersionMajor, FIRMWARE_VERSION_MAJOR);
    PUT(Identification, FirmwareVersionMinor, FIRMWARE_VERSION_MINOR);
    PUT(Identification, RuntimeMilliseconds, (unsigned)(now_ms % 1000u));
    PUT(Identification, RuntimeSeconds, (unsigned)(now_ms / 1000u & 0xFFFFu));
}

static void extended_identification(uint8_t *data)
{
    PUT(ExtendedIdentification, SerialNumber, SERIAL_NUMBER);
    PUT(ExtendedIdentification, Temperature, temperature_c());
    PUT(ExtendedIdentification, ResetCause, reset_cause);
    PUT(ExtendedIdentification, WDGResetCount, retained.watchdog_resets);
    PUT(ExtendedIdentification, TcmdCount, retained.telecommands & 0xFFFF);
    PUT(ExtendedIdentification, TlmCount, retained.telemetry & 0xFFFF);
}

static void loop_times(uint8_t *data)
{
    PUT(StartAndLoopTime, StartupTime, ms(startup_us));
    PUT(StartAndLoopTime, LoopTime, ms(retained.loop_us));
    PUT(StartAndLoopTime, MaxLoopTime, ms(retained.longest_loop_us));
}

static void power_status(uint8_t *data)
{
    PUT(PowerStatus, Current, supply_sample());
    PUT(PowerStatus, Status, supply_imager_on());
    PUT(PowerStatus, MaxCurrent, ms(retained.highest_ua));
    PUT(PowerStatus, MinCurrent, ms(retained.lowest_ua));
}

static void log_status(uint8_t *data)
{
    PUT(LogStatus, Temp, temperature_c());
    PUT(LogStatus, Runtime, (uint32_t)(time_us() / 1000000u));
    PUT(LogStatus, WDGcounter, retained.watchdog_resets);
    PUT(LogStatus, Status, task_status);
    PUT(LogStatus, SW, supply_imager_on());
    PUT(LogStatus, Current, supply_sample());
    PUT(LogStatus, MaxCurrent, ms(retained.highest_ua));
    PUT(LogStatus, MinCurrent, ms(retained.lowest_ua));
    memcpy(data + LOG_FLAGS_OFFSET, retained.flags, FLAG_BYTES);
}

static void supply_report(uint8_t *data)
{
    PUT(SupplyReport, SramCurrent, supply_current_ma(CHANNEL_MEMORY));
    PUT(SupplyReport, ImagerCurrent, supply_current_ma(CHANNEL_IMAGER));
    PUT(SupplyReport, LatchUps, retained.latch_ups);
    PUT(SupplyReport, PowerCycles, retained.power_cycles);
}

static void loop_status(uint8_t *data)
{
    PUT(LoopStatus, Iterations, retained.iterations);
    PUT(LoopStatus, ModeFlag, mode());
    PUT(LoopStatus, FrameRate, SETTING(u16, SetFrameRate, FrameRate));
    PUT(LoopStatus, DiscardDelay, SETTING(u16, SetDiscardDelay, Delay));
    PUT(LoopStatus, Bank, SETTING(u8, SelectImageBank, Bank));
    PUT(LoopStatus, CameraPage, SETTING(u8, SetCameraRegisterPage, Page));
    PUT(LoopStatus, Running, retained.looping);
}

/* --- camera and image ------------------------------------------------------------------------- */

static void image_setup(uint8_t *data)
{
    PUT(ImageSetup, FirstLine, 0);
    PUT(ImageSetup, Width, PICTURE_COLUMNS);
    PUT(ImageSetup, Height, PICTURE_ROWS);
}

static void camera_register(uint8_t *data)
{
    PUT(CameraRegister, Address, selected_address);
    PUT(CameraRegister, Value, selected_value);
    PUT(CameraRegister, Valid, selected_valid);
}

static void camera_timing(uint8_t *data)
{
    PUT(CameraTiming, SetupTime, ms(retained.camera_setup_us));
    PUT(CameraTiming, ExposureUpdateTime, ms(retained.exposure_setup_us));
    PUT(CameraTiming, CaptureTime, ms(retained.discard_us + retained.capture_us));
}

static void timing_summary(uint8_t *data)
{
    PUT(TimingSummary, ImageCaptureTime,
        ms(retained.discard_us + retained.capture_us + retained.transfer_us));
    PUT(TimingSummary, DetectionTime, ms(retained.detect_us));
    PUT(TimingSummary, IdentificationTime, ms(retained.match_us));
}

static void phase_times(uint8_t *data)
{
    PUT(PhaseTimes, Idle, retained.idle_us);
    PUT(PhaseTimes, Discard, retained.discard_us);
    PUT(PhaseTimes, Capture, retained.capture_us);
    PUT(PhaseTimes, Transfer, retained.transfer_us);
    PUT(PhaseTimes, Detect, retained.detect_us);
    PUT(PhaseTimes, Match, retained.match_us);
    PUT(PhaseTimes, Attitude, retained.attitude_us);
    PUT(PhaseTimes, LoopTotal, retained.loop_us);
}

/* A block of 256 bytes comes as two reads. */
static void image_block(uint8_t *data)
{
    unsigned length = 32u << SETTING(u8, ImageBlockSet, BlockSize);
    unsigned start = SETTING(u16, ImageBlockSet, BlockNumber) * length;
    if (length > BLOCK_BYTES) {
        start += second_half ? BLOCK_BYTES : 0;
        second_half = !second_half;
        length = BLOCK_BYTES;
    }
    memcpy(data, PICTURE + start, length);
}

/* --- the latest image ------------------------------------------------------------------------- */

static const struct detection *found(void)
{
    static const struct detection nothing;
    return results.detected ? &results.detection : &nothing;
}

static int identified(void)
{
    int count = 0;
    if (results.identified)
        for (int i = 0; i < results.identification.count; i++)
            count += results.identification.stars[i] != NO_IDENTITY;
    return count;
}

static void summary(uint8_t *data)
{
    PUT(DetectionSummary, NumStarsDetected, found()->count);
    PUT(DetectionSummary, NumInvalidStars, found()->invalid);
    PUT(DetectionSummary, AmountOfNoise, found()->noise);
    PUT(DetectionSummary, ImageDarkValue, found()->dark_value);
}

static void thresholds(uint8_t *data)
{
    PUT(DetectionThresholdValues, DarkThreshold, found()->dark_value);
    PUT(DetectionThresholdValues, DetectionThreshold,
        SETTING(u8, setDetectionThresholds, DetectionThreshold));
    PUT(DetectionThresholdValues, StarThreshold,
        SETTING(u8, setDetectionThresholds, StarThreshold));
}

static void counts(uint8_t *data)
{
    PUT(Results, DarkValue, found()->dark_value);
    PUT(Results, Detected, found()->count);
    PUT(Results, Invalid, found()->invalid);
    PUT(Results, Noise, found()->noise);
    PUT(Results, IDMode, SETTING(u8, setIDMode, IdMode));
    PUT(Results, ID, identified());
}

static bool communication_failed(void)
{
    for (int flag = FLAG_UART_ProtocolError; flag <= FLAG_I2C_TCMD_TooManyparm; flag++)
        if (flag_raised((uint8_t)flag))
            return true;
    return false;
}

static void performance(uint8_t *data)
{
    uint32_t took_us =
        latest_us[STEP_DETECTION] + latest_us[STEP_IDENTIFICATION] + latest_us[STEP_ATTITUDE];
    PUT(PerformanceParameters, NumStarsDetected, found()->count);
    PUT(PerformanceParameters, StarImageNoise, found()->noise);
    PUT(PerformanceParameters, InvalidStars, found()->invalid);
    PUT(PerformanceParameters, NumberOfStarsID, identified());
    PUT(PerformanceParameters, Idmode, SETTING(u8, setIDMode, IdMode));
    PUT(PerformanceParameters, ImageDarkValue, found()->dark_value);
    PUT(PerformanceParameters, ImageCaptureSuccess, retained.image_present);
    PUT(PerformanceParameters, DetectionSuccess, found()->count > 0);
    PUT(PerformanceParameters, IdentificationSuccess, results.identified);
    PUT(PerformanceParameters, AttitudeSuccess, retained.solved);
    PUT(PerformanceParameters, ProcessingTimeError, took_us > PROCESSING_LIMIT_US);
    PUT(PerformanceParameters, MaxStarsDetected, flag_raised(FLAG_MaxStarsDetection));
    PUT(PerformanceParameters, LessThanThreeStarsInFoV, flag_raised(FLAG_LessThanThreeStarsInFoV));
    PUT(PerformanceParameters, CommsError, communication_failed());
}

/* --- attitude --------------------------------------------------------------------------------- */

/* Without any attitude: no rotation. */
static const struct attitude *latest_attitude(void)
{
    static struct attitude none = {.quaternion = {0, 0, 0, 1}};
    none.mode = results.mode;
    return attitude.present ? &attitude : &none;
}

static void quaternion(uint8_t *data)
{
    const float *q = latest_attitude()->quaternion;
    PUT(Quaternion, Qbar0, q[0]);
    PUT(Quaternion, Qbar1, q[1]);
    PUT(Quaternion, Qbar2, q[2]);
    PUT(Quaternion, Qbar3, q[3]);
}

static void boresight(float direction[3])
{
    float rotation[3][3];
    dcm(rotation, latest_attitude()->quaternion);
    memcpy(direction, rotation[2], sizeof rotation[2]);
}

static void spherical(uint8_t *data)
{
    float direction[3], right_ascension, declination;
    boresight(direction);
    angles_of(direction, &right_ascension, &declination);
    PUT(SphereicalCoordinates, Declination, declination);
    PUT(SphereicalCoordinates, RightAscension, right_ascension);
}

static void attitude_data(uint8_t *data)
{
    const float *q = latest_attitude()->quaternion;
    float direction[3], right_ascension, declination;
    boresight(direction);
    angles_of(direction, &right_ascension, &declination);
    PUT(AttitudeData, Qbar0, q[0]);
    PUT(AttitudeData, Qbar1, q[1]);
    PUT(AttitudeData, Qbar2, q[2]);
    PUT(AttitudeData, Qbar3, q[3]);
    PUT(AttitudeData, RightAscension, right_ascension);
    PUT(AttitudeData, Declination, declination);
    PUT(AttitudeData, BSVX, direction[0]);
    PUT(AttitudeData, BSVY, direction[1]);
    PUT(AttitudeData, BSVZ, direction[2]);
}

static void attitude_quaternion(uint8_t *data)
{
    const struct attitude *latest = latest_attitude();
    PUT(AttitudeQuaternion, Q0, latest->quaternion[0]);
    PUT(AttitudeQuaternion, Q1, latest->quaternion[1]);
    PUT(AttitudeQuaternion, Q2, latest->quaternion[2]);
    PUT(AttitudeQuaternion, Q3, latest->quaternion[3]);
    PUT(AttitudeQuaternion, FrameCounter, latest->frame);
    PUT(AttitudeQuaternion, ImageTime, latest->image_ms);
    PUT(AttitudeQuaternion, Mode, latest->mode);
    PUT(AttitudeQuaternion, Matched, latest->matched);
    PUT(AttitudeQuaternion, Valid, retained.solved);
}

/* In profile published nothing is rated, which a sigma of pi rad indicates. */
static void quality(uint8_t *data)
{
    const double unknown = 3.14159265358979;
    PUT(Quality, SigmaX, unknown);
    PUT(Quality, SigmaY, unknown);
    PUT(Quality, SigmaZ, unknown);
    PUT(Quality, Scale, 1.0);
}

/* --- dispatch --------------------------------------------------------------------------------- */

static const struct {
    uint8_t id;
    void (*fill)(uint8_t *data);
} sources[] = {
    {CUBESTAR_TLM_Identification, identification},
    {CUBESTAR_TLM_ExtendedIdentification, extended_identification},
    {CUBESTAR_TLM_StartAndLoopTime, loop_times},
    {CUBESTAR_TLM_PowerStatus, power_status},
    {CUBESTAR_TLM_LogStatus, log_status},
    {CUBESTAR_TLM_SupplyReport, supply_report},
    {CUBESTAR_TLM_LoopStatus, loop_status},
    {CUBESTAR_TLM_ImageSetup, image_setup},
    {CUBESTAR_TLM_CameraRegister, camera_register},
    {CUBESTAR_TLM_CameraTiming, camera_timing},
    {CUBESTAR_TLM_TimingSummary, timing_summary},
    {CUBESTAR_TLM_PhaseTimes, phase_times},
    {CUBESTAR_TLM_ImageBlock, image_block},
    {CUBESTAR_TLM_DetectionSummary, summary},
    {CUBESTAR_TLM_DetectionThresholdValues, thresholds},
    {CUBESTAR_TLM_Results, counts},
    {CUBESTAR_TLM_PerformanceParameters, performance},
    {CUBESTAR_TLM_Quaternion, quaternion},
    {CUBESTAR_TLM_SphereicalCoordinates, spherical},
    {CUBESTAR_TLM_AttitudeData, attitude_data},
    {CUBESTAR_TLM_AttitudeQuaternion, attitude_quaternion},
    {CUBESTAR_TLM_Quality, quality},
};

/* Settings and times of the steps, from the tables. */
static void fill_by_table(uint8_t id, uint8_t *data)
{
    for (int i = 0; i < SETTINGS_SHOWN; i++) {
        const struct setting_shown *shown = &settings_shown[i];
        if (shown->id == id)
            memcpy(data + shown->to, retained.settings + shown->from, shown->size);
    }
    for (int i = 0; i < TIMES_SHOWN; i++) {
        const struct time_shown *shown = &times_shown[i];
        uint32_t us = (shown->longest ? longest_us : latest_us)[shown->step];
        if (shown->id == id)
            put(data, (struct field){(uint16_t)(8 * shown->to), FIELD_U16, 1.0}, ms(us));
    }
}

void telemetry_fill(const struct telemetry *message, uint8_t *data)
{
    switch (message->id) {
    case CUBESTAR_TLM_ErrorFlags:
        memcpy(data, retained.flags, FLAG_BYTES);
        return;
    case CUBESTAR_TLM_TcmdProcessed:
        PUT(TcmdProcessed, Processed, !queue_waiting() && !command_running);
        return;
    case CUBESTAR_TLM_TaskStatus:
        PUT(TaskStatus, taskStatus, task_status);
        return;
    case CUBESTAR_TLM_SRAMTestResults:
        PUT(SRAMTestResults, TestResult, memory_test);
        return;
    case CUBESTAR_TLM_IS_Register:
        PUT(IS_Register, DataL, selected_value);
        return;
    case CUBESTAR_TLM_UploadStatus:
        PUT(UploadStatus, NextBlock, next_block);
        PUT(UploadStatus, BlocksReceived, blocks_received);
        return;
    case CUBESTAR_TLM_Profile:
        memcpy(data, published_profile, message->length);
        return;
    }
    for (unsigned i = 0; i < sizeof sources / sizeof *sources; i++)
        if (sources[i].id == message->id)
            sources[i].fill(data);
    fill_by_table(message->id, data);
    star_report_fill(message->id, data);
}
