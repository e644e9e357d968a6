// Grey values of an image sensor: pixels.py, one row at a time.
//
// Every operation is that of the reference, in its order and precision: no fused multiplication, no
// other association. So the result is equal to the bit.

#include <cmath>
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
    light::NoiseSource noise;
};

// Buffers of one row.
struct Row {
    explicit Row(int columns)
        : charge(columns), signal(columns),
          numbers(columns + 2 * light::NUMBERS_OF_BLOCK) {}
    std::vector<float> charge, signal;
    std::vector<uint32_t> numbers;
    std::vector<float> means;
};

void add_charge(const PixelModel &model, int64_t start, float *__restrict charge) {
    const int columns = model.columns;
    const float *__restrict light = model.light + start;
    if (model.response) {
        const float *__restrict response = model.response + start;
        for (int x = 0; x < columns; ++x) charge[x] = light[x] * response[x];
    } else {
        for (int x = 0; x < columns; ++x) charge[x] = light[x];
    }
    const float dark = model.dark;
    if (model.dark_share) {
        const float *__restrict share = model.dark_share + start;
        for (int x = 0; x < columns; ++x) charge[x] = charge[x] + share[x] * dark;
    } else {
        for (int x = 0; x < columns; ++x) charge[x] = charge[x] + dark;
    }
}

void add_noise(const PixelModel &model, int64_t start, Row &row) {
    const int columns = model.columns;
    const int64_t block = start / light::NUMBERS_OF_BLOCK;
    const int skipped = (int)(start % light::NUMBERS_OF_BLOCK);
    for (int n = 0; n < skipped + columns; n += light::NUMBERS_OF_BLOCK)
        light::philox(model.noise, block + n / light::NUMBERS_OF_BLOCK, row.numbers.data() + n);
    const uint32_t *__restrict numbers = row.numbers.data() + skipped;
    float *__restrict signal = row.signal.data();
    for (int x = 0; x < columns; ++x) signal[x] = light::normal(model.noise, numbers[x]);
    const float *__restrict charge = row.charge.data();
    const float *__restrict light = model.light + start;
    const float shot = model.shot, steady = model.steady;
    if (model.shot_of_light)
        for (int x = 0; x < columns; ++x)
            signal[x] = signal[x] * std::sqrt(charge[x] * shot + steady) + charge[x];
    else
        for (int x = 0; x < columns; ++x)
            signal[x] = signal[x] * std::sqrt((charge[x] - light[x]) * shot + steady) + charge[x];
}

void amplify(const PixelModel &model, int64_t start, int y, float *__restrict signal) {
    const int columns = model.columns;
    const float *__restrict gain = model.gain + (y & 1) * columns;
    const float black = model.black;
    for (int x = 0; x < columns; ++x) signal[x] = (signal[x] - black) * gain[x];
    if (model.pattern) {
        const float *__restrict pattern = model.pattern + start;
        for (int x = 0; x < columns; ++x) signal[x] = signal[x] + pattern[x];
    }
    const float offset = model.offset;
    for (int x = 0; x < columns; ++x) signal[x] = signal[x] + offset;
}

void quantise(const PixelModel &model, const float *__restrict signal, uint8_t *__restrict grey) {
    const float full_scale = model.full_scale, step = model.step;
    for (int x = 0; x < model.columns; ++x) {
        float value = signal[x] + 0.5f;
        value = value > 0.0f ? value : 0.0f;
        value = value < full_scale ? value : full_scale;
        grey[x] = (uint8_t)(int32_t)(value * step);
    }
}

}  // namespace

// Grey values (end - first, columns) of the rows from ``first`` up to ``end``.
extern "C" void light_grey_values(const PixelModel *model, int32_t first, int32_t end,
                                  uint8_t *grey) {
    const int columns = model->columns;
    Row row(columns);
    int64_t hot = 0, repair = 0;
    while (hot < model->hots && model->hot[hot] < (int64_t)first * columns) ++hot;
    while (repair < model->repairs && model->repaired[repair] < (int64_t)first * columns) ++repair;
    for (int y = first; y < end; ++y) {
        const int64_t start = (int64_t)y * columns, next = start + columns;
        add_charge(*model, start, row.charge.data());
        for (; hot < model->hots && model->hot[hot] < next; ++hot)
            row.charge[model->hot[hot] - start] += model->hot_charge[hot];
        if (model->noisy)
            add_noise(*model, start, row);
        else
            row.signal = row.charge;
        float *signal = row.signal.data();
        amplify(*model, start, y, signal);
        // Of two neighbours that are repaired, each sees the other one as it was.
        row.means.clear();
        int64_t mean = repair;
        for (; mean < model->repairs && model->repaired[mean] < next; ++mean) {
            const int64_t x = model->repaired[mean] - start;
            row.means.push_back((signal[x - 1] + signal[x + 1]) * 0.5f);
        }
        for (const float value : row.means) signal[model->repaired[repair++] - start] = value;
        quantise(*model, signal, grey + (int64_t)(y - first) * columns);
    }
}
