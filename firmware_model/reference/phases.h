/* SPDX-License-Identifier: BSD-2-Clause */
/* Duration of each phase of the work, by the timer and by the core's cycle counter. */
#pragma once

#include <stdint.h>

#include "cubestar_tables.h"

/* Phases measured by the cycle counter: steps that telemetry shows, and one that it does not. */
enum phase {
    PHASE_SEARCH = STEP_SEARCH,
    PHASE_CENTROID = STEP_CENTROID,
    PHASE_CORRECTION = STEP_CORRECTION,
    PHASE_VECTORS = STEP_VECTORS,
    PHASE_REDUCTION = STEP_REDUCTION,
    PHASE_DISTANCES = STEP_DISTANCES,
    PHASE_VOTES = STEP_VOTES,
    PHASE_IDENTITIES = STEP_IDENTITIES,
    PHASE_VERIFICATION = STEP_VERIFICATION,
    PHASE_SELECTION = STEP_SELECTION,
    PHASE_PREDICTION = STEPS,
    PHASES
};

#ifdef __arm__

/* The time of an inner phase does not count for the outer one. */
void phase_begin(enum phase phase);
void phase_end(enum phase phase);

/* Clears the counts; stores the counts since then as the steps' times. */
void phases_clear(void);
void phases_record(void);

/* Times of the steps since the last reset, in us. */
extern uint32_t latest_us[STEPS], longest_us[STEPS];
void step_took(enum step step, uint32_t us);

#else /* tests of the algorithms on another machine */

static inline void phase_begin(enum phase phase) { (void)phase; }
static inline void phase_end(enum phase phase) { (void)phase; }

#endif
