/* SPDX-License-Identifier: BSD-2-Clause */
/* From centroids in the image to unit vectors, in single precision.
 *
 * CubeStar thesis, section 4.1.4 (equations 4.1.3 to 4.1.5), section 4.1.5 (equation 4.1.6).
 * Camera axes are x right, y down, z out of the lens. */
#pragma once

/* Calibration of camera and lens, set by telecommands 8 to 12. */
struct camera {
    float focal_length_mm;
    float fx, fy, cx, cy;  /* px */
    float k1, k2, p1, p2;
};

/* Undistorted image points, x and y in px. */
void undistort(float (*out)[2], const float (*in)[2], int count, const struct camera *camera);

/* Unit vectors in camera axes of undistorted points. */
void unit_vectors(float (*out)[3], const float (*points)[2], int count,
                  const struct camera *camera);

/* Unit vector of a right ascension and a declination in rad. */
void direction_of(float right_ascension, float declination, float out[3]);

/* Right ascension, -pi to pi, and declination of a unit vector, in rad. */
void angles_of(const float direction[3], float *right_ascension, float *declination);

/* Cosine of the angle between the boresight and the farthest image corner. */
float field_cosine(const struct camera *camera);
