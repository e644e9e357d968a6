/* SPDX-License-Identifier: BSD-2-Clause */
/* Image plane search, region growing and centroids.
 *
 * CubeStar thesis, sections 4.1.1 to 4.1.3 and 5.3.3. Details left open there are those of
 * firmware_model/cubestar/detection/sampled.py. */
#include "detection.h"

#include "phases.h"

#define PIXELS ((uint32_t)IMAGE_ROWS * IMAGE_COLUMNS)

/* A visited pixel in one word: its place in the upper 24 bits, its value in the lower 8. */
#define PLACE(pixel) ((pixel) >> 8)
#define VALUE(pixel) ((pixel) & 0xFFu)

/* The growing area. */
struct area {
    uint8_t *picture;
    unsigned count, most;
    uint8_t threshold;
    uint32_t pixels[MOST_PIXELS];
};

bool detection_valid(const struct detection_config *c) {
    return c->step >= 1 && c->x_start < c->x_end && c->x_end <= IMAGE_COLUMNS &&
           c->y_start < c->y_end && c->y_end <= IMAGE_ROWS && c->min_pixels >= 1 &&
           c->min_pixels <= c->max_pixels && c->max_pixels <= MOST_PIXELS &&
           c->grid_size % 2 == 1 && c->max_stars >= 1 && c->max_stars <= MOST_STARS &&
           c->max_invalid <= MOST_INVALID;
}

static bool grow(struct area *area, uint32_t place, uint8_t value);

/* Grows into a neighbour if it is bright; false if the area is too large. */
static bool grow_into(struct area *area, uint32_t place) {
    uint8_t value = area->picture[place];
    if (value <= area->threshold) {
        return true;
    }
    return area->count < area->most && grow(area, place, value);
}

/* Adds a pixel and its bright neighbours: left, right, up, down. */
static bool grow(struct area *area, uint32_t place, uint8_t value) {
    uint32_t column = place % IMAGE_COLUMNS;
    area->pixels[area->count++] = place << 8 | value;
    area->picture[place] = 0;
    return (column == 0 || grow_into(area, place - 1)) &&
           (column == IMAGE_COLUMNS - 1 || grow_into(area, place + 1)) &&
           (place < IMAGE_COLUMNS || grow_into(area, place - IMAGE_COLUMNS)) &&
           (place + IMAGE_COLUMNS >= PIXELS || grow_into(area, place + IMAGE_COLUMNS));
}

/* Mean of `count` places with this sum, rounded. */
static int32_t middle(uint32_t sum, uint32_t count) {
    return (int32_t)((2 * sum + count) / (2 * count));
}

/* Mean position weighted by intensity, over the grid around the brightest pixel; among several,
 * around their mean. */
static void find_centroid(const struct area *area, int grid_size, float centroid[2]) {
    uint32_t peak = 0, tied = 0, tied_x = 0, tied_y = 0;
    for (unsigned i = 0; i < area->count; i++) {
        uint32_t place = PLACE(area->pixels[i]), value = VALUE(area->pixels[i]);
        if (value > peak) {
            peak = value;
            tied = tied_x = tied_y = 0;
        }
        if (value == peak) {
            tied++;
            tied_x += place % IMAGE_COLUMNS;
            tied_y += place / IMAGE_COLUMNS;
        }
    }
    int32_t x_middle = middle(tied_x, tied), y_middle = middle(tied_y, tied), half = grid_size / 2;
    int32_t x_sum = 0, y_sum = 0, weight = 0;
    for (unsigned i = 0; i < area->count; i++) {
        uint32_t place = PLACE(area->pixels[i]);
        int32_t value = (int32_t)VALUE(area->pixels[i]);
        int32_t x = (int32_t)(place % IMAGE_COLUMNS) - x_middle;
        int32_t y = (int32_t)(place / IMAGE_COLUMNS) - y_middle;
        if (x >= -half && x <= half && y >= -half && y <= half) {
            x_sum += value * x;
            y_sum += value * y;
            weight += value;
        }
    }
    float total = (float)weight;
    centroid[0] = (float)x_middle + (float)x_sum / total;
    centroid[1] = (float)y_middle + (float)y_sum / total;
}

/* Adds a complete area that is large enough to the list. */
static void list_star(const struct area *area, int grid_size, struct detection *found) {
    uint16_t intensity = 0;
    for (unsigned i = 0; i < area->count; i++) {
        intensity += VALUE(area->pixels[i]);
    }
    found->sizes[found->count] = (uint8_t)area->count;
    found->intensities[found->count] = intensity;
    phase_begin(PHASE_CENTROID);
    find_centroid(area, grid_size, found->centroids[found->count]);
    phase_end(PHASE_CENTROID);
    found->count++;
}

static enum search_end end_of(const struct detection *found,
                              const struct detection_config *config) {
    if (found->count == config->max_stars) {
        return SEARCH_STARS;
    }
    if (found->invalid > config->max_invalid) {
        return SEARCH_INVALID;
    }
    return found->noise > config->max_noise ? SEARCH_NOISE : SEARCH_COMPLETE;
}

void detect_stars(uint8_t *picture, uint32_t *visited, const struct detection_config *config,
                  struct detection *found) {
    static struct area area;
    uint32_t *listed = visited;
    uint8_t seed = config->detection_threshold > config->star_threshold
                       ? config->detection_threshold
                       : config->star_threshold;
    uint32_t total = 0, background = 0;
    *found = (struct detection){.end = SEARCH_COMPLETE};
    area.picture = picture;
    area.most = config->max_pixels;
    area.threshold = config->star_threshold;
    phase_begin(PHASE_SEARCH);
    for (uint32_t y = config->y_start; y < config->y_end; y += config->step) {
        const uint8_t *row = picture + y * IMAGE_COLUMNS;
        for (uint32_t x = config->x_start; x < config->x_end; x += config->step) {
            uint8_t value = row[x];
            if (value <= seed) {
                total += value;
                background++;
                continue;
            }
            area.count = 0;
            bool complete = grow(&area, y * IMAGE_COLUMNS + x, value);
            if (!complete) {
                found->invalid++;
            } else if (area.count < config->min_pixels) {
                found->noise++;
            } else {
                list_star(&area, config->grid_size, found);
            }
            for (unsigned i = 0; i < area.count; i++) {
                *listed++ = area.pixels[i];
            }
            found->end = end_of(found, config);
            if (found->end != SEARCH_COMPLETE) {
                goto ended;
            }
        }
    }
ended:
    found->dark_value = background ? (uint8_t)((total + background / 2) / background) : 0;
    for (const uint32_t *pixel = visited; pixel < listed; pixel++) {
        picture[PLACE(*pixel)] = (uint8_t)VALUE(*pixel);
    }
    phase_end(PHASE_SEARCH);
}
