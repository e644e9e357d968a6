/* SPDX-License-Identifier: BSD-2-Clause */
/* Star list and pair list, constant arrays in flash; catalogue_tables.c is generated.
 *
 * CubeStar thesis, sections 4.3.2, 4.3.4 (reduced catalogue) and 5.3.2. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "catalogue_tables.h" /* generated: sizes, and cosines of the published radii */

/* CUT_COSINE: 35 deg, assisted matching (section 4.3.4). TRACKING_COSINE: 30.3 deg (5.3.4). */

/* Type in flash, whatever precision the program computes in. */
typedef float stored_float;

/* Inertial unit vectors of the stars, by ascending Hipparcos number. */
extern const stored_float star_x[STAR_COUNT], star_y[STAR_COUNT], star_z[STAR_COUNT];

/* Hipparcos numbers, for telemetry only; not in the published flash. */
extern const uint32_t star_hip[STAR_COUNT];

/* Pairs by ascending angle, in rad. */
extern const uint16_t pair_first[PAIR_COUNT], pair_second[PAIR_COUNT];
extern const stored_float pair_angle[PAIR_COUNT];

/* A list of pairs: that in flash, or the reduced one in RAM. */
struct pair_list {
    int count;
    const uint16_t *first, *second;
    const stored_float *angle;
};

/* Marks the stars whose angle from a unit vector has at least this cosine; returns their number. */
int stars_near(const float boresight[3], float cosine, bool near[STAR_COUNT]);

/* Number of those stars. */
int count_near(const float boresight[3], float cosine);

/* The pairs of marked stars, in RAM; valid until the next call. */
struct pair_list reduced_pairs(const bool near[STAR_COUNT]);

struct pair_list all_pairs(void);
