/* Sizes that the algorithms' arrays are made for.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef LIMITS_H
#define LIMITS_H

#define IMAGE_COLUMNS 1024
#define IMAGE_ROWS 512

/* Stars found in a picture; the list's length (CubeStar thesis, section 5.3.3). */
#define MOST_STARS 20
#define MOST_STAR_PAIRS (MOST_STARS * (MOST_STARS - 1) / 2)

/* Largest values of setStarPixels' MaxPixels and setDetectionVariables' MaxInvalidStars, MaxNoise. */
#define MOST_PIXELS 100
#define MOST_INVALID 50
#define MOST_NOISE 255

#endif
