/* SPDX-License-Identifier: BSD-2-Clause */
/* An image from the search to the attitude, lost in space, with the settings after a reset. */
#include "catalogue.h"
#include "defaults.h" /* generated: DETECTION_DEFAULTS, CAMERA_DEFAULTS, MARGIN_DEFAULT */
#include "detection.h"
#include "geometry.h"
#include "matching.h"
#include "phases.h"
#include "quest.h"

#define PICTURE ((uint8_t *)0x80000000u)
#define VISITED ((uint32_t *)0x80080000u)

struct detection found;
struct identification identified;
float quaternion[4];
float rotation[3][3];

int process_picture(void) {
    static const struct detection_config config = DETECTION_DEFAULTS;
    static const struct camera camera = CAMERA_DEFAULTS;
    static float points[MOST_STARS][2], vectors[MOST_STARS][3];
    static float inertial[MOST_STARS][3], measured[MOST_STARS][3], weights[MOST_STARS];
    int used = 0;
    detect_stars(PICTURE, VISITED, &config, &found);
    phase_begin(PHASE_CORRECTION);
    undistort(points, (const float (*)[2])found.centroids, found.count, &camera);
    phase_end(PHASE_CORRECTION);
    phase_begin(PHASE_VECTORS);
    unit_vectors(vectors, (const float (*)[2])points, found.count, &camera);
    phase_end(PHASE_VECTORS);
    identify(&identified, (const float (*)[3])vectors, found.count, 0, MARGIN_DEFAULT);
    phase_begin(PHASE_ATTITUDE);
    for (int i = 0; i < identified.count; i++) {
        int star = identified.stars[i];
        if (star == NO_IDENTITY) {
            continue;
        }
        inertial[used][0] = star_x[star];
        inertial[used][1] = star_y[star];
        inertial[used][2] = star_z[star];
        for (int axis = 0; axis < 3; axis++) {
            measured[used][axis] = vectors[i][axis];
        }
        weights[used++] = identified.votes[i];
    }
    int solved = quest(quaternion, (const float (*)[3])measured, (const float (*)[3])inertial,
                       weights, used);
    if (solved) {
        dcm(rotation, quaternion);
    }
    phase_end(PHASE_ATTITUDE);
    return solved;
}
