/* SPDX-License-Identifier: BSD-2-Clause */
/* Phases that are timed from outside, at the entry of these two functions. */
#pragma once

enum phase {
    PHASE_SEARCH,
    PHASE_CENTROID,
    PHASE_CORRECTION,
    PHASE_VECTORS,
    PHASE_REDUCTION,
    PHASE_DISTANCES,
    PHASE_VOTES,
    PHASE_IDENTITIES,
    PHASE_VERIFICATION,
    PHASE_SELECTION,
    PHASE_PREDICTION,
    PHASE_ATTITUDE
};

void phase_begin(enum phase phase);
void phase_end(enum phase phase);
