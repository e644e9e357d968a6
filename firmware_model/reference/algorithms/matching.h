/* SPDX-License-Identifier: BSD-2-Clause */
/* Identities of centroids: geometric voting (lost in space, or near a boresight) and tracking.
 *
 * CubeStar thesis, sections 4.3 (Algorithm 2 as printed), 4.5 and 5.3.4. */
#pragma once

#include <stdint.h>

#include "limits.h"

#define NO_IDENTITY (-1)

/* Outcome of an identification. */
enum match_outcome { IDENTIFIED, TOO_FEW_CENTROIDS, TOO_FEW_MATCHED };

struct identification {
    int count;                    /* centroids */
    int16_t stars[MOST_STARS];    /* index into the star list or NO_IDENTITY */
    uint8_t votes[MOST_STARS];    /* verification votes, kept when identification fails */
    enum match_outcome outcome;
};

/* Lost in space, or near `boresight` if that is not NULL. */
void identify(struct identification *result, const float (*directions)[3], int count,
              const float *boresight, float margin_rad);

/* From the attitude (inertial to camera) of the previous iteration, among the stars near its
 * boresight. */
void track(struct identification *result, const float (*directions)[3], int count,
           const float attitude[3][3]);

/* Votes of a star as a fraction of the largest possible number; 0 without identity. */
float confidence(const struct identification *result, int star);

/* Indices of up to three identified stars, by votes, then intensity; returns their number. */
int best_stars(const struct identification *result, const uint16_t *intensities, uint8_t best[3]);
