/* From picture to attitude: detection, matching and QUEST, with the time of each step.
 *
 * CubeStar thesis, sections 5.3.3 to 5.3.5.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef PROCESSING_H
#define PROCESSING_H

#include <stdbool.h>
#include <stdint.h>

#include "algorithms/detection.h"
#include "algorithms/matching.h"

/* Results of the latest picture. Interrupts read them: what is not marked is being made. */
struct results {
    volatile bool detected, identified; /* whether there is a detection, an identification */
    volatile unsigned generation;       /* another number for other results */
    struct detection detection;
    float points[MOST_STARS][2];  /* undistorted centroids, px */
    float vectors[MOST_STARS][3]; /* camera unit vectors */
    struct identification identification;
    uint8_t mode; /* MatchMode that identified it */
    uint8_t best[3];
    volatile uint8_t selected; /* how many of `best` */
    uint32_t frame, image_ms;
};

extern struct results results;

/* There is nothing to report about the latest picture. */
void discard_results(void);

/* Each is false when it failed. */
bool detect(void);
bool identify_stars(void);
bool select_best(void);
bool estimate(void);

/* All of them. */
bool process(void);

/* Captures a picture first. */
void capture_and_process(void);

#endif
