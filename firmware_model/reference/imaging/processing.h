/* SPDX-License-Identifier: BSD-2-Clause */
/* From image to attitude: detection, matching and QUEST, with the time of each step.
 *
 * CubeStar thesis, sections 5.3.3 to 5.3.5. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "algorithms/detection.h"
#include "algorithms/matching.h"

/* Results of the latest image. Interrupts read them: unmarked parts are incomplete. */
struct results {
    volatile bool detected, identified; /* marks of a detection and an identification */
    volatile unsigned generation;       /* changes with the results */
    struct detection detection;
    float points[MOST_STARS][2];  /* undistorted centroids, px */
    float vectors[MOST_STARS][3]; /* camera unit vectors */
    struct identification identification;
    uint8_t mode; /* MatchMode that identified it */
    uint8_t best[3];
    volatile uint8_t selected; /* number of valid entries in `best` */
    uint32_t frame, image_ms;
};

extern struct results results;

/* Discards the report on the latest image. */
void discard_results(void);

/* Each returns false if it failed. */
bool detect(void);
bool identify_stars(void);
bool select_best(void);
bool estimate(void);

/* Detects, identifies and estimates. */
bool process(void);

/* Captures an image first. */
void capture_and_process(void);
