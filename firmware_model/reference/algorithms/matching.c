/* SPDX-License-Identifier: BSD-2-Clause */
/* Voting as printed in Algorithm 2, verification, selection; tracking.
 *
 * CubeStar thesis, sections 4.3.3, 4.3.4, 4.5 and 5.3.4 (binary search, angles computed once,
 * preallocated arrays). Details left open there are those of firmware_model/cubestar/matching.
 */
#include "matching.h"

#include <math.h>
#include <string.h>

#include "catalogue.h"
#include "float_functions.h"
#include "phases.h"

#define FEWEST_STARS 3    /* lost in space or assisted (section 4.3.5) */
#define FEWEST_TRACKED 2  /* section 4.5 */

static float pair_angles[MOST_STAR_PAIRS];
static uint16_t ballot[MOST_STARS][STAR_COUNT];
static bool near[STAR_COUNT];

/* Angle in rad between two unit vectors: equation 4.3.1. */
static float angle_between(const float a[3], const float b[3]) {
    float product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if (product > 1.0f) {
        product = 1.0f;
    } else if (product < -1.0f) {
        product = -1.0f;
    }
    return arc_cosine(product);
}

static void star_vector(int star, float out[3]) {
    out[0] = star_x[star];
    out[1] = star_y[star];
    out[2] = star_z[star];
}

static void forget(struct identification *result, int count, enum match_outcome outcome) {
    for (int i = 0; i < count; i++) {
        result->stars[i] = NO_IDENTITY;
    }
    result->outcome = outcome;
}

static void begin(struct identification *result, int count) {
    result->count = count;
    forget(result, MOST_STARS, TOO_FEW_CENTROIDS);
    memset(result->votes, 0, sizeof result->votes);
}

/* First entry of an ascending list that is not below the wanted value. */
static int first_not_below(const struct pair_list *list, float wanted) {
    int low = 0, high = list->count;
    while (low < high) {
        int middle = (low + high) / 2;
        if (list->angle[middle] < wanted) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

static void measure_pairs(const float (*directions)[3], int count) {
    float *angle = pair_angles;
    for (int first = 0; first < count; first++) {
        for (int second = first + 1; second < count; second++) {
            *angle++ = angle_between(directions[first], directions[second]);
        }
    }
}

/* Every listed pair with the same angle votes with both its stars for both centroids. */
static void vote(const struct pair_list *list, int count, float margin) {
    const float *angle = pair_angles;
    memset(ballot, 0, sizeof ballot);
    for (int first = 0; first < count; first++) {
        for (int second = first + 1; second < count; second++, angle++) {
            float last = *angle + margin;
            for (int at = first_not_below(list, *angle - margin);
                 at < list->count && !(list->angle[at] > last); at++) {
                int star = list->first[at], partner = list->second[at];
                ballot[first][star]++;
                ballot[first][partner]++;
                ballot[second][partner]++;
                ballot[second][star]++;
            }
        }
    }
}

/* The first star with the most votes. */
static int16_t elected(const uint16_t votes[STAR_COUNT]) {
    int16_t best = NO_IDENTITY;
    uint16_t most = 0;
    for (int star = 0; star < STAR_COUNT; star++) {
        if (votes[star] > most) {
            most = votes[star];
            best = (int16_t)star;
        }
    }
    return best;
}

/* A pair of centroids whose identities have the same angle confirms both. */
static void verify(struct identification *result, float margin) {
    const float *angle = pair_angles;
    for (int first = 0; first < result->count; first++) {
        for (int second = first + 1; second < result->count; second++, angle++) {
            if (result->stars[first] == NO_IDENTITY || result->stars[second] == NO_IDENTITY) {
                continue;
            }
            float one[3], other[3];
            star_vector(result->stars[first], one);
            star_vector(result->stars[second], other);
            if (fabsf(angle_between(one, other) - *angle) <= margin) {
                result->votes[first]++;
                result->votes[second]++;
            }
        }
    }
}

/* Keeps the stars within one vote of the most; returns their number. */
static int select_stars(struct identification *result) {
    uint8_t most = 0;
    int kept = 0;
    for (int i = 0; i < result->count; i++) {
        if (result->votes[i] > most) {
            most = result->votes[i];
        }
    }
    for (int i = 0; i < result->count; i++) {
        if (result->votes[i] + 1 < most) {
            result->stars[i] = NO_IDENTITY;
        }
        kept += result->stars[i] != NO_IDENTITY;
    }
    return kept;
}

void identify(struct identification *result, const float (*directions)[3], int count,
              const float *boresight, float margin_rad) {
    struct pair_list list = all_pairs();
    begin(result, count);
    if (boresight) {
        phase_begin(PHASE_REDUCTION);
        stars_near(boresight, CUT_COSINE, near);
        list = reduced_pairs(near);
        phase_end(PHASE_REDUCTION);
    }
    if (count < FEWEST_STARS) {
        return;
    }
    phase_begin(PHASE_DISTANCES);
    measure_pairs(directions, count);
    phase_end(PHASE_DISTANCES);
    phase_begin(PHASE_VOTES);
    vote(&list, count, margin_rad);
    phase_end(PHASE_VOTES);
    phase_begin(PHASE_IDENTITIES);
    for (int i = 0; i < count; i++) {
        result->stars[i] = elected(ballot[i]);
    }
    phase_end(PHASE_IDENTITIES);
    phase_begin(PHASE_VERIFICATION);
    verify(result, margin_rad);
    phase_end(PHASE_VERIFICATION);
    phase_begin(PHASE_SELECTION);
    result->outcome = IDENTIFIED;
    if (select_stars(result) < FEWEST_STARS) {
        forget(result, count, TOO_FEW_MATCHED);
    }
    phase_end(PHASE_SELECTION);
}

void track(struct identification *result, const float (*directions)[3], int count,
           const float attitude[3][3]) {
    float closest[MOST_STARS];
    int matched = 0;
    begin(result, count);
    if (count < FEWEST_TRACKED) {
        return;
    }
    phase_begin(PHASE_REDUCTION);
    stars_near(attitude[2], TRACKING_COSINE, near);
    phase_end(PHASE_REDUCTION);
    phase_begin(PHASE_PREDICTION);
    for (int i = 0; i < count; i++) {
        closest[i] = INFINITY;
    }
    for (int star = 0; star < STAR_COUNT; star++) {
        if (!near[star]) {
            continue;
        }
        float predicted[3];
        for (int axis = 0; axis < 3; axis++) {
            predicted[axis] = star_x[star] * attitude[axis][0] + star_y[star] * attitude[axis][1] +
                              star_z[star] * attitude[axis][2];
        }
        for (int i = 0; i < count; i++) {
            float x = directions[i][0] - predicted[0], y = directions[i][1] - predicted[1];
            float z = directions[i][2] - predicted[2];
            float chord2 = x * x + y * y + z * z;
            if (chord2 < closest[i]) {
                closest[i] = chord2;
                result->stars[i] = (int16_t)star;
            }
        }
    }
    for (int i = 0; i < count; i++) {
        if (!(closest[i] <= REACH_CHORD2)) {
            result->stars[i] = NO_IDENTITY;
        }
        result->votes[i] = result->stars[i] != NO_IDENTITY;
        matched += result->votes[i];
    }
    phase_end(PHASE_PREDICTION);
    result->outcome = IDENTIFIED;
    if (matched < FEWEST_TRACKED) {
        forget(result, count, TOO_FEW_MATCHED);
    }
}

float confidence(const struct identification *result, int star) {
    int most = result->count > 2 ? result->count - 1 : 1;
    return result->stars[star] == NO_IDENTITY ? 0.0f
                                              : (float)result->votes[star] / (float)most;
}

int best_stars(const struct identification *result, const uint16_t *intensities, uint8_t best[3]) {
    bool taken[MOST_STARS] = {false};
    int found = 0;
    for (; found < 3; found++) {
        int chosen = -1;
        for (int i = 0; i < result->count; i++) {
            if (taken[i] || result->stars[i] == NO_IDENTITY) {
                continue;
            }
            if (chosen < 0 || result->votes[i] > result->votes[chosen] ||
                (result->votes[i] == result->votes[chosen] &&
                 intensities[i] > intensities[chosen])) {
                chosen = i;
            }
        }
        if (chosen < 0) {
            break;
        }
        taken[chosen] = true;
        best[found] = (uint8_t)chosen;
    }
    return found;
}
