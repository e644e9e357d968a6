/* SPDX-License-Identifier: BSD-2-Clause */
/* QUEST: the attitude that best rotates the catalogue's vectors to the measured ones.
 *
 * CubeStar thesis, section 4.4 (equations 4.4.8 to 4.4.10) and 5.3.5 (equation 5.3.1). A quaternion
 * is scalar last and rotates inertial vectors to camera vectors. */
#pragma once

#include <stdbool.h>

/* False if the vectors do not determine an attitude. */
bool quest(float quaternion[4], const float (*measured)[3], const float (*reference)[3],
           const float *weights, int count);

/* Direction cosine matrix, inertial to camera. */
void dcm(float rotation[3][3], const float quaternion[4]);
