/* SPDX-License-Identifier: BSD-2-Clause */
/* Finding stars in an image: image plane search, region growing, centroids.
 *
 * CubeStar thesis, sections 4.1.1 to 4.1.3 and 5.3.3. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "limits.h"

/* Settings of telecommands 20 to 23; see detection_valid for valid ones. */
struct detection_config {
    uint16_t step;                /* distance of sampled pixels and rows */
    uint16_t x_start, x_end;      /* end excluded */
    uint16_t y_start, y_end;
    uint8_t detection_threshold;  /* a sample above both thresholds starts an area */
    uint8_t star_threshold;       /* a neighbour above it joins */
    uint8_t min_pixels;           /* smaller areas are noise */
    uint8_t max_pixels;           /* larger areas are invalid */
    uint8_t grid_size;            /* side of the centroid's square, odd */
    uint8_t max_stars;            /* at most MOST_STARS */
    uint8_t max_invalid;
    uint8_t max_noise;
};

enum search_end { SEARCH_COMPLETE, SEARCH_STARS, SEARCH_INVALID, SEARCH_NOISE };

/* Result of a search, in its order, row by row. */
struct detection {
    int count;
    float centroids[MOST_STARS][2];  /* x and y in px */
    uint8_t sizes[MOST_STARS];       /* pixels */
    uint16_t intensities[MOST_STARS];
    uint16_t invalid;                /* areas above the maximum size */
    uint16_t noise;                  /* areas below the minimum size */
    uint8_t dark_value;              /* mean of the sampled background */
    enum search_end end;
};

/* Words for the list of visited pixels at the settings' limits: areas that are stars or
 * invalid, and areas that are noise. */
#define VISITED_WORDS                                    \
    ((MOST_STARS + MOST_INVALID + 1) * MOST_PIXELS +     \
     (MOST_NOISE + 1) * (MOST_PIXELS - 1))

/* Whether the region lies in the image and the limits in their ranges. */
bool detection_valid(const struct detection_config *config);

/* Finds the stars of an image [IMAGE_ROWS][IMAGE_COLUMNS]. Visited pixels are zeroed meanwhile
 * and written back from `visited` [VISITED_WORDS] at the end. */
void detect_stars(uint8_t *picture, uint32_t *visited, const struct detection_config *config,
                  struct detection *found);
