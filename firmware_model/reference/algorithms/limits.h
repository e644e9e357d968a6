/* SPDX-License-Identifier: BSD-2-Clause */
/* Sizes of the algorithms' arrays. */
#pragma once

#define IMAGE_COLUMNS 1024
#define IMAGE_ROWS 512

/* Length of the star list (CubeStar thesis, section 5.3.3). */
#define MOST_STARS 20
#define MOST_STAR_PAIRS (MOST_STARS * (MOST_STARS - 1) / 2)

/* Largest values of setStarPixels' MaxPixels; setDetectionVariables' MaxInvalidStars, MaxNoise. */
#define MOST_PIXELS 100
#define MOST_INVALID 50
#define MOST_NOISE 255
