/* QUEST: the attitude that best turns the catalogue's vectors into the measured ones.
 *
 * CubeStar thesis, section 4.4 (equations 4.4.8 to 4.4.10) and 5.3.5 (equation 5.3.1). A quaternion
 * is scalar last and turns inertial vectors into camera vectors.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef QUEST_H
#define QUEST_H

#include <stdbool.h>

/* False when the vectors do not determine an attitude. */
bool quest(float quaternion[4], const float (*measured)[3], const float (*reference)[3],
           const float *weights, int count);

/* Direction cosine matrix, inertial to camera. */
void dcm(float rotation[3][3], const float quaternion[4]);

#endif
