/* SPDX-License-Identifier: BSD-2-Clause */
/* From image to attitude, as firmware_model/cubestar/processing in profile published. */
#include "processing.h"

#include "algorithms/catalogue.h"
#include "algorithms/geometry.h"
#include "algorithms/quest.h"
#include "capture.h"
#include "drivers/clock.h"
#include "phases.h"
#include "state.h"

#define FEWEST_STARS 3
#define MARGIN_SCALE ((float)CUBESTAR_TC_setIDMargin_Margin_SCALE)

enum { TRACKING = CUBESTAR_MATCH_MODE_TRACKING, ASSISTED = CUBESTAR_MATCH_MODE_ASSISTED,
       LOST = CUBESTAR_MATCH_MODE_LOST_IN_SPACE };

struct results results = {.mode = LOST};

_Static_assert(VISITED_WORDS * 4 <= EXTERNAL_RAM_BYTES - PICTURE_BYTES, "the list is too long");

static bool failed(uint8_t status, uint8_t flag)
{
    task_status = status;
    raise_flag(flag);
    return false;
}

void discard_results(void)
{
    results.detected = results.identified = false;
    results.selected = 0;
    results.detection.count = results.identification.count = 0;
    results.mode = LOST;
    results.generation++;
    retained.solved = 0;
}

/* --- detection -------------------------------------------------------------------------------- */

static uint8_t at_least_one(uint8_t value)
{
    return value ? value : 1;
}

/* Settings that this hardware cannot follow are replaced by the nearest possible ones. */
static struct detection_config detection_config(void)
{
    uint8_t stars = at_least_one(SETTING(u8, setDetectionVariables, MaxStars));
    return (struct detection_config){
        .step = at_least_one(SETTING(u8, setDetectionRegion, StepSize)),
        .x_start = SETTING(u16, setDetectionRegion, Xstart),
        .x_end = (uint16_t)(SETTING(u16, setDetectionRegion, Xend) + 1),
        .y_start = SETTING(u16, setDetectionRegion, Ystart),
        .y_end = (uint16_t)(SETTING(u16, setDetectionRegion, Yend) + 1),
        .detection_threshold = SETTING(u8, setDetectionThresholds, DetectionThreshold),
        .star_threshold = SETTING(u8, setDetectionThresholds, StarThreshold),
        .min_pixels = SETTING(u8, setStarPixels, MinPixels),
        .max_pixels = SETTING(u8, setStarPixels, MaxPixels),
        .grid_size = SETTING(u8, setDetectionVariables, GridSize) | 1,
        .max_stars = stars < MOST_STARS ? stars : MOST_STARS,
        .max_invalid = SETTING(u8, setDetectionVariables, MaxInvalidStars),
        .max_noise = SETTING(u8, setDetectionVariables, MaxNoise),
    };
}

static struct camera camera(void)
{
    return (struct camera){
        .focal_length_mm = SETTING(f32, setFocalLength, FocalLength),
        .fx = SETTING(f32, setFocalLengthComponents, Fx),
        .fy = SETTING(f32, setFocalLengthComponents, Fy),
        .cx = SETTING(f32, setPrincipalPoint, Cx),
        .cy = SETTING(f32, setPrincipalPoint, Cy),
        .k1 = SETTING(f32, setRadialDistortionGains, K1),
        .k2 = SETTING(f32, setRadialDistortionGains, K2),
        .p1 = SETTING(f32, setTangentalDistortionGains, P1),
        .p2 = SETTING(f32, setTangentalDistortionGains, P2),
    };
}

bool detect(void)
{
    static const uint8_t end_flags[] = {
        [SEARCH_COMPLETE] = NO_FLAG,
        [SEARCH_STARS] = FLAG_MaxStarsDetection,
        [SEARCH_INVALID] = FLAG_MaxInvalidStarsDetectionError,
        [SEARCH_NOISE] = FLAG_MaxNoiseDetected,
    };
    discard_results();
    if (!retained.image_present)
        return failed(CUBESTAR_TASK_STATUS_DETECTION_FAILED, FLAG_StatusError);
    task_status = CUBESTAR_TASK_STATUS_DETECTING;
    uint64_t started = time_us();
    struct detection_config config = detection_config();
    struct camera calibration = camera();
    static struct detection found;
    static float points[MOST_STARS][2], vectors[MOST_STARS][3];
    phases_clear();
    detect_stars(PICTURE, (uint32_t *)(void *)(PICTURE + PICTURE_BYTES), &config, &found);
    phase_begin(PHASE_CORRECTION);
    undistort(points, (const float(*)[2])found.centroids, found.count, &calibration);
    phase_end(PHASE_CORRECTION);
    phase_begin(PHASE_VECTORS);
    unit_vectors(vectors, (const float(*)[2])points, found.count, &calibration);
    phase_end(PHASE_VECTORS);
    phases_record();
    retained.detect_us = since(started);
    step_took(STEP_DETECTION, retained.detect_us);
    raise_flag(end_flags[found.end]);
    if (found.count < FEWEST_STARS)
        raise_flag(FLAG_LessThanThreeStarsDetected);
    results.detection = found;
    memcpy(results.points, points, sizeof points);
    memcpy(results.vectors, vectors, sizeof vectors);
    results.frame = retained.frame;
    results.image_ms = retained.image_ms;
    results.detected = true;
    task_status = found.count ? CUBESTAR_TASK_STATUS_DETECTED
                              : CUBESTAR_TASK_STATUS_DETECTION_FAILED;
    return found.count > 0;
}

/* --- identification --------------------------------------------------------------------------- */

/* The mode flag decides; without an attitude and a hint the node is lost in space. */
static uint8_t choose_mode(void)
{
    if (mode() == LOST)
        return LOST;
    if (!attitude.present && !retained.hint_present) {
        raise_flag(FLAG_IDModeError);
        return LOST;
    }
    return mode();
}

/* The hint until the first fix after it, then the boresight of the latest attitude. */
static void expected_boresight(float boresight[3])
{
    if (!attitude.present || retained.hint_present)
        direction_of(SETTING(f32, setTrackingMode, RightAscension),
                     SETTING(f32, setTrackingMode, Declination), boresight);
    else
        memcpy(boresight, attitude.rotation[2], sizeof attitude.rotation[2]);
}

static void match(uint8_t chosen, struct identification *found)
{
    const float(*vectors)[3] = (const float(*)[3])results.vectors;
    float margin = (float)SETTING(u8, setIDMargin, Margin) / MARGIN_SCALE, boresight[3];
    if (chosen == TRACKING && attitude.present) {
        track(found, vectors, results.detection.count, (const float(*)[3])attitude.rotation);
        return;
    }
    if (chosen != LOST)
        expected_boresight(boresight);
    identify(found, vectors, results.detection.count, chosen == LOST ? NULL : boresight, margin);
}

/* Raises flags with details of a failure. */
static void explain(uint8_t chosen, const struct identification *found)
{
    bool too_few = found->outcome == TOO_FEW_MATCHED, votes = false;
    for (int i = 0; i < found->count; i++)
        votes |= found->votes[i] != 0;
    if (too_few && !votes)
        raise_flag(FLAG_IDSearchError);
    if (chosen == LOST)
        return;
    if (chosen == TRACKING && too_few)
        raise_flag(FLAG_RateExceeded);
    float boresight[3];
    struct camera calibration = camera();
    expected_boresight(boresight);
    if (count_near(boresight, field_cosine(&calibration)) < FEWEST_STARS)
        raise_flag(FLAG_LessThanThreeStarsInFoV);
    if (!count_near(boresight, chosen == TRACKING ? TRACKING_COSINE : CUT_COSINE))
        raise_flag(FLAG_ReducedIDListSizeError);
}

bool identify_stars(void)
{
    static const uint8_t outcome_flags[] = {
        [TOO_FEW_CENTROIDS] = FLAG_LessThanThreeStarsDetected,
        [TOO_FEW_MATCHED] = FLAG_LessThanThreeStarsID,
    };
    results.identified = false;
    results.selected = 0;
    retained.solved = 0;
    if (!results.detected)
        return failed(CUBESTAR_TASK_STATUS_IDENTIFICATION_FAILED, FLAG_StatusError);
    task_status = CUBESTAR_TASK_STATUS_IDENTIFYING;
    uint64_t started = time_us();
    static struct identification found;
    phases_clear();
    uint8_t chosen = choose_mode();
    match(chosen, &found);
    phases_record();
    results.mode = chosen;
    retained.match_us = since(started);
    step_took(STEP_IDENTIFICATION, retained.match_us);
    if (found.outcome != IDENTIFIED) {
        explain(chosen, &found);
        set_mode(LOST);
        return failed(CUBESTAR_TASK_STATUS_IDENTIFICATION_FAILED, outcome_flags[found.outcome]);
    }
    results.identification = found;
    results.identified = true;
    task_status = CUBESTAR_TASK_STATUS_IDENTIFIED;
    return true;
}

/* --- attitude --------------------------------------------------------------------------------- */

bool select_best(void)
{
    if (!results.identified) {
        raise_flag(FLAG_StatusError);
        return false;
    }
    uint64_t started = time_us();
    uint8_t best[3];
    results.selected = 0;
    int count = best_stars(&results.identification, results.detection.intensities, best);
    memcpy(results.best, best, sizeof best);
    results.selected = (uint8_t)count;
    step_took(STEP_BEST, since(started));
    return true;
}

bool estimate(void)
{
    if (!results.identified)
        return failed(CUBESTAR_TASK_STATUS_CALCULATION_FAILED, FLAG_QuestindexError);
    task_status = CUBESTAR_TASK_STATUS_CALCULATING;
    uint64_t started = time_us();
    static float measured[MOST_STARS][3], reference[MOST_STARS][3], weights[MOST_STARS];
    int kept = 0;
    for (int i = 0; i < results.identification.count; i++) {
        int star = results.identification.stars[i];
        if (star == NO_IDENTITY)
            continue;
        memcpy(measured[kept], results.vectors[i], sizeof measured[kept]);
        reference[kept][0] = star_x[star];
        reference[kept][1] = star_y[star];
        reference[kept][2] = star_z[star];
        weights[kept++] = results.identification.votes[i];
    }
    struct attitude latest = {
        .frame = results.frame,
        .image_ms = results.image_ms,
        .matched = (uint8_t)kept,
        .mode = results.mode,
        .present = 1,
    };
    if (!quest(latest.quaternion, (const float(*)[3])measured, (const float(*)[3])reference,
               weights, kept)) {
        set_mode(LOST);
        return failed(CUBESTAR_TASK_STATUS_CALCULATION_FAILED, FLAG_QuestindexError);
    }
    dcm(latest.rotation, latest.quaternion);
    retained.attitude_us = since(started);
    step_took(STEP_ATTITUDE, retained.attitude_us);
    set_attitude(&latest);
    set_mode(TRACKING);
    retained.hint_present = 0;
    retained.solved = 1;
    task_status = CUBESTAR_TASK_STATUS_CALCULATED;
    return true;
}

bool process(void)
{
    return detect() && identify_stars() && estimate();
}

void capture_and_process(void)
{
    if (capture_image(NULL))
        process();
    else
        discard_results();
}
