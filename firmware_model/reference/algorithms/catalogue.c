/* SPDX-License-Identifier: BSD-2-Clause */
/* Searches of the star list and the pair list. */
#include "catalogue.h"

#include <stddef.h>

/* The reduced pair list; the generator computes the largest size over all directions. */
static uint16_t reduced_first[REDUCED_PAIRS], reduced_second[REDUCED_PAIRS];
static stored_float reduced_angle[REDUCED_PAIRS];

static bool is_near(const float boresight[3], float cosine, int star) {
    return star_x[star] * boresight[0] + star_y[star] * boresight[1] +
               star_z[star] * boresight[2] >=
           cosine;
}

int stars_near(const float boresight[3], float cosine, bool near[STAR_COUNT]) {
    int count = 0;
    for (int star = 0; star < STAR_COUNT; star++) {
        near[star] = is_near(boresight, cosine, star);
        count += near[star];
    }
    return count;
}

int count_near(const float boresight[3], float cosine) {
    int count = 0;
    for (int star = 0; star < STAR_COUNT; star++) {
        count += is_near(boresight, cosine, star);
    }
    return count;
}

struct pair_list reduced_pairs(const bool near[STAR_COUNT]) {
    int kept = 0;
    for (int pair = 0; pair < PAIR_COUNT && kept < REDUCED_PAIRS; pair++) {
        if (near[pair_first[pair]] && near[pair_second[pair]]) {
            reduced_first[kept] = pair_first[pair];
            reduced_second[kept] = pair_second[pair];
            reduced_angle[kept] = pair_angle[pair];
            kept++;
        }
    }
    return (struct pair_list){kept, reduced_first, reduced_second, reduced_angle};
}

struct pair_list all_pairs(void) {
    return (struct pair_list){PAIR_COUNT, pair_first, pair_second, pair_angle};
}
