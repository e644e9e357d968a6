// Grey values of an image sensor: pixels.py, one row at a time.
//
// Every operation is that of the reference, in its order and precision: no fused multiplication, no
// other association. So the result is equal to the bit. Most pixels need none: where they are
// alike, a table has the grey values of little light by their random numbers; where they are not, a
// bound shows that all of a segment are 0.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "noise.h"

namespace {

struct PixelModel {
    const float *light, *response, *dark_share, *gain, *pattern;
    const int64_t *hot;
    const float *hot_charge;
    const int64_t *repaired;
    int64_t hots, repairs;
    int32_t columns, noisy, shot_of_light;
    float dark, shot, steady, black, offset, full_scale, step;
    float dim;  // light up to which the table holds
    const uint8_t *dim_values;  // by the highest bits of a pixel's number; none: not known
    const float *most_response, *most_dark_share, *most_pattern;  // of each segment, or none
    float most_gain;
    light::NoiseSource noise;
};

constexpr int SEGMENT = 16;  // pixels of a row that are computed together, or taken from the table
constexpr int TABLE_BITS = 14;
constexpr uint8_t UNKNOWN = 255;
constexpr float ROUNDING = 1e-3f;  // more than the noise's function differs where pieces meet

// Pixels of row ``y`` from column ``first`` up to ``end``; ``start`` is the place of the row's first.
struct Span {
    int64_t start;
    int y, first, end;
};

// Buffers of one row.
struct Row {
    explicit Row(int columns)
        : charge(columns), signal(columns), numbers(columns + 2 * light::NUMBERS_OF_BLOCK),
          brightest(columns / SEGMENT), loudest(columns / SEGMENT),
          computed(columns / SEGMENT + 1) {}
    std::vector<float> charge, signal, means;
    std::vector<uint32_t> numbers;
    std::vector<float> brightest, loudest;  // of each segment: light, and noise
    std::vector<uint8_t> computed;
    std::vector<Span> spans;
};

void add_charge(const PixelModel &model, const Span &span, float *__restrict charge) {
    const float *__restrict light = model.light + span.start;
    if (model.response) {
        const float *__restrict response = model.response + span.start;
        for (int x = span.first; x < span.end; ++x) charge[x] = light[x] * response[x];
    } else {
        for (int x = span.first; x < span.end; ++x) charge[x] = light[x];
    }
    const float dark = model.dark;
    if (model.dark_share) {
        const float *__restrict share = model.dark_share + span.start;
        for (int x = span.first; x < span.end; ++x) charge[x] = charge[x] + share[x] * dark;
    } else {
        for (int x = span.first; x < span.end; ++x) charge[x] = charge[x] + dark;
    }
}

// The numbers of the row that begins at ``start``; the first is returned.
const uint32_t *draw(const PixelModel &model, int64_t start, uint32_t *numbers) {
    const int64_t block = start / light::NUMBERS_OF_BLOCK;
    const int skipped = (int)(start % light::NUMBERS_OF_BLOCK);
    for (int n = 0; n < skipped + model.columns; n += light::NUMBERS_OF_BLOCK)
        light::philox(model.noise, block + n / light::NUMBERS_OF_BLOCK, numbers + n);
    return numbers + skipped;
}

void add_noise(const PixelModel &model, const Span &span, const uint32_t *__restrict numbers,
               const float *__restrict charge, float *__restrict signal) {
    for (int x = span.first; x < span.end; ++x) signal[x] = light::normal(model.noise, numbers[x]);
    const float *__restrict light = model.light + span.start;
    const float shot = model.shot, steady = model.steady;
    if (model.shot_of_light)
        for (int x = span.first; x < span.end; ++x)
            signal[x] = signal[x] * std::sqrt(charge[x] * shot + steady) + charge[x];
    else
        for (int x = span.first; x < span.end; ++x)
            signal[x] = signal[x] * std::sqrt((charge[x] - light[x]) * shot + steady) + charge[x];
}

void amplify(const PixelModel &model, const Span &span, float *__restrict signal) {
    const float *__restrict gain = model.gain + (span.y & 1) * model.columns;
    const float black = model.black;
    for (int x = span.first; x < span.end; ++x) signal[x] = (signal[x] - black) * gain[x];
    if (model.pattern) {
        const float *__restrict pattern = model.pattern + span.start;
        for (int x = span.first; x < span.end; ++x) signal[x] = signal[x] + pattern[x];
    }
    const float offset = model.offset;
    for (int x = span.first; x < span.end; ++x) signal[x] = signal[x] + offset;
}

void quantise(const PixelModel &model, const Span &span, const float *__restrict signal,
              uint8_t *__restrict grey) {
    const float full_scale = model.full_scale;
    for (int x = span.first; x < span.end; ++x) {
        float value = signal[x] + 0.5f;
        value = value > 0.0f ? value : 0.0f;
        value = value < full_scale ? value : full_scale;
        grey[x] = (uint8_t)(int32_t)(value * model.step);
    }
}

// Ascending places of special pixels; those of the present row are ``first`` up to ``end``.
struct Places {
    const int64_t *places;
    int64_t count, first = 0, end = 0;

    // Goes on to the row that begins at ``start``; rows come in order.
    void enter(int64_t start, int columns) {
        for (first = end; first < count && places[first] < start;) ++first;
        for (end = first; end < count && places[end] < start + columns;) ++end;
    }
};

// Highest light of a segment; it is not negative, so its bits are in its order.
float brightest(const float *light) {
    int32_t most = 0;
    for (int x = 0; x < SEGMENT; ++x) {
        int32_t bits;
        std::memcpy(&bits, light + x, sizeof bits);
        most = bits > most ? bits : most;
    }
    float found;
    std::memcpy(&found, &most, sizeof found);
    return found;
}

// Takes ``grey`` from the table, and marks the segments of the row in which that is not enough: a
// pixel has more than dim light, or a number with several values.
void look_up(const PixelModel &model, int64_t start, const uint32_t *__restrict numbers,
             uint8_t *__restrict grey, uint8_t *__restrict computed) {
    for (int first = 0; first < model.columns; first += SEGMENT) {
        uint8_t greatest = 0;
        for (int x = first; x < first + SEGMENT; ++x)
            grey[x] = model.dim_values[numbers[x] >> (32 - TABLE_BITS)];
        for (int x = first; x < first + SEGMENT; ++x) greatest = std::max(greatest, grey[x]);
        computed[first / SEGMENT] =
            brightest(model.light + start + first) > model.dim || greatest == UNKNOWN;
    }
}

// Largest noise of a segment, at least 0. Numbers below 2^31 are noise above 0, the larger the lower
// they are.
float loudest(const light::NoiseSource &noise, const uint32_t *numbers) {
    constexpr uint32_t HALF = 1u << 31;  // with it inverted, numbers are in order as signed ones
    int32_t least = 0;
    for (int x = 0; x < SEGMENT; ++x) {
        const int32_t number = (int32_t)(numbers[x] ^ HALF);
        least = number < least ? number : least;
    }
    return least < 0 ? light::normal(noise, (uint32_t)least ^ HALF) + ROUNDING : 0.0f;
}

// Marks the segments of the row that begins at ``start`` in which a pixel may be above 0; ``grey`` of
// the others becomes 0.
//
// The bound has a pixel's operations in their order, each of which grows with its operands.
void find_black(const PixelModel &model, int64_t start, const uint32_t *numbers, uint8_t *grey,
                Row &row) {
    const int segments = model.columns / SEGMENT;
    for (int n = 0; n < segments; ++n) {
        row.brightest[n] = brightest(model.light + start + n * SEGMENT);
        row.loudest[n] = loudest(model.noise, numbers + n * SEGMENT);
    }
    const float *__restrict light = row.brightest.data(), *__restrict noise = row.loudest.data();
    const float *__restrict response = model.most_response + start / SEGMENT;
    const float *__restrict dark_share = model.most_dark_share + start / SEGMENT;
    const float *__restrict pattern = model.most_pattern + start / SEGMENT;
    uint8_t *__restrict computed = row.computed.data();
    for (int n = 0; n < segments; ++n) {
        const float charge = light[n] * response[n] + dark_share[n] * model.dark;
        const float signal = noise[n] * std::sqrt(charge * model.shot + model.steady) + charge;
        const float above = signal - model.black > 0.0f ? signal - model.black : 0.0f;
        const float value = above * model.most_gain + pattern[n] + model.offset + 0.5f;
        computed[n] = !(value * model.step < 1.0f);
    }
    std::memset(grey, 0, model.columns);
}

void mark_special(int64_t start, const Places &hot, const Places &repaired, uint8_t *computed) {
    for (int64_t n = hot.first; n < hot.end; ++n) computed[(hot.places[n] - start) / SEGMENT] = 1;
    for (int64_t n = repaired.first; n < repaired.end; ++n)
        for (int side = -1; side <= 1; ++side)
            computed[(repaired.places[n] - start + side) / SEGMENT] = 1;
}

// The segments to compute, adjacent ones as one span.
void find_spans(int64_t start, int y, int columns, const uint8_t *computed,
                std::vector<Span> &spans) {
    spans.clear();
    for (int first = 0; first < columns; first += SEGMENT) {
        if (!computed[first / SEGMENT]) continue;
        const int end = std::min(first + SEGMENT, columns);
        if (!spans.empty() && spans.back().end == first)
            spans.back().end = end;
        else
            spans.push_back({start, y, first, end});
    }
}

}  // namespace

// Grey values (end - first, columns) of the rows from ``first`` up to ``end``.
extern "C" void light_grey_values(const PixelModel *model, int32_t first, int32_t end,
                                  uint8_t *grey) {
    const int columns = model->columns;
    Row row(columns);
    Places hot{model->hot, model->hots}, repaired{model->repaired, model->repairs};
    for (int y = first; y < end; ++y, grey += columns) {
        const int64_t start = (int64_t)y * columns;
        hot.enter(start, columns);
        repaired.enter(start, columns);
        const uint32_t *numbers =
            model->noisy ? draw(*model, start, row.numbers.data()) : nullptr;
        uint8_t *computed = row.computed.data();
        if (model->dim_values)
            look_up(*model, start, numbers, grey, computed);
        else if (model->most_pattern)
            find_black(*model, start, numbers, grey, row);
        else
            std::memset(computed, 1, row.computed.size());
        mark_special(start, hot, repaired, computed);
        find_spans(start, y, columns, computed, row.spans);
        float *charge = row.charge.data();
        float *signal = model->noisy ? row.signal.data() : charge;
        for (const Span &span : row.spans) add_charge(*model, span, charge);
        for (int64_t n = hot.first; n < hot.end; ++n)
            charge[hot.places[n] - start] += model->hot_charge[n];
        for (const Span &span : row.spans) {
            if (model->noisy) add_noise(*model, span, numbers, charge, signal);
            amplify(*model, span, signal);
        }
        // Of two neighbours that are repaired, each sees the other one as it was.
        row.means.clear();
        for (int64_t n = repaired.first; n < repaired.end; ++n) {
            const int64_t x = repaired.places[n] - start;
            row.means.push_back((signal[x - 1] + signal[x + 1]) * 0.5f);
        }
        for (int64_t n = repaired.first; n < repaired.end; ++n)
            signal[repaired.places[n] - start] = row.means[n - repaired.first];
        for (const Span &span : row.spans) quantise(*model, span, signal, grey);
    }
}
