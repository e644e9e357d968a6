/* Star list and pair list, constant arrays in flash; catalogue_tables.c is generated.
 *
 * CubeStar thesis, sections 4.3.2, 4.3.4 (reduced catalogue) and 5.3.2.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef CATALOGUE_H
#define CATALOGUE_H

#include <stdbool.h>
#include <stdint.h>

#include "catalogue_tables.h" /* generated: sizes, and cosines of the published radii */

/* CUT_COSINE: 35 deg, assisted matching (section 4.3.4). TRACKING_COSINE: 30.3 deg (5.3.4). */

/* As flash has it, whatever precision the program computes in. */
typedef float stored_float;

/* Stars by rising Hipparcos number: inertial unit vectors. */
extern const stored_float star_x[STAR_COUNT], star_y[STAR_COUNT], star_z[STAR_COUNT];

/* Hipparcos numbers, for telemetry alone; the published flash did not have them. */
extern const uint32_t star_hip[STAR_COUNT];

/* Pairs by rising angle, in rad. */
extern const uint16_t pair_first[PAIR_COUNT], pair_second[PAIR_COUNT];
extern const stored_float pair_angle[PAIR_COUNT];

/* A list of pairs: that in flash, or the reduced one in RAM. */
struct pair_list {
    int count;
    const uint16_t *first, *second;
    const stored_float *angle;
};

/* Marks the stars whose angle from a unit vector has at least this cosine; how many there are. */
int stars_near(const float boresight[3], float cosine, bool near[STAR_COUNT]);

/* How many those are. */
int count_near(const float boresight[3], float cosine);

/* The pairs of marked stars, in RAM, until the next call. */
struct pair_list reduced_pairs(const bool near[STAR_COUNT]);

/* The whole list. */
struct pair_list all_pairs(void);

#endif
