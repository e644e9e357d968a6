/* SPDX-License-Identifier: BSD-2-Clause */
/* Distortion, unit vectors and directions; order of operations as in
 * firmware_model/attitude/geometry.py. */
#include "geometry.h"

#include <math.h>

#include "float_functions.h"
#include "limits.h"

#define PITCH_MM 0.0056f /* of the MLX75412's pixels */

void undistort(float (*out)[2], const float (*in)[2], int count, const struct camera *c) {
    for (int i = 0; i < count; i++) {
        float x = (in[i][0] - c->cx) / c->fx, y = (in[i][1] - c->cy) / c->fy;
        float xx = x * x, yy = y * y, xy = x * y;
        float r2 = xx + yy;
        float radial = 1.0f + c->k1 * r2 + c->k2 * (r2 * r2);
        float x_u = x * radial + c->p2 * (r2 + 2.0f * xx) + 2.0f * c->p1 * xy;
        float y_u = y * radial + c->p1 * (r2 + 2.0f * yy) + 2.0f * c->p2 * xy;
        out[i][0] = c->cx + c->fx * x_u;
        out[i][1] = c->cy + c->fy * y_u;
    }
}

void unit_vectors(float (*out)[3], const float (*points)[2], int count, const struct camera *c) {
    float scale = PITCH_MM / c->focal_length_mm;
    for (int i = 0; i < count; i++) {
        float x = (points[i][0] - c->cx) * scale, y = (points[i][1] - c->cy) * scale;
        float z = 1.0f / sqrtf(1.0f + x * x + y * y);
        out[i][0] = x * z;
        out[i][1] = y * z;
        out[i][2] = z;
    }
}

void direction_of(float right_ascension, float declination, float out[3]) {
    float along = cosine(declination);
    out[0] = along * cosine(right_ascension);
    out[1] = along * sine(right_ascension);
    out[2] = sine(declination);
}

void angles_of(const float direction[3], float *right_ascension, float *declination) {
    float x = direction[0], y = direction[1], z = direction[2];
    *right_ascension = arc_tangent(y, x);
    *declination = arc_tangent(z, sqrtf(x * x + y * y));
}

float field_cosine(const struct camera *c) {
    float scale = PITCH_MM / c->focal_length_mm;
    float x = (c->cx > IMAGE_COLUMNS - c->cx ? c->cx : IMAGE_COLUMNS - c->cx) * scale;
    float y = (c->cy > IMAGE_ROWS - c->cy ? c->cy : IMAGE_ROWS - c->cy) * scale;
    return 1.0f / sqrtf(1.0f + x * x + y * y);
}
