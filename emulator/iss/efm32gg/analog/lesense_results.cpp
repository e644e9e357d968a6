// LESENSE's results: evaluation, buffer, decoder, interrupts. EFM32GG Reference Manual, 25.3.5 to
// 25.3.7.
#include "efm32gg/analog/lesense.h"

namespace efm32gg {

using namespace lesense;

namespace {

constexpr int SOURCE = 50;                        // of DMA requests
constexpr int LOWER = 57, UPPER = 58, DECODER = 59;  // PRS sources: results, decoder
enum When : uint32_t { NOT, LEVEL, POSITIVE_EDGE, NEGATIVE_EDGE };
// TCONFA.PRSACT with DECCTRL.PRSCNT: channel 0 counts, channel 1 is the direction.
enum Count : uint32_t { UP = 1, DOWN = 2 };

}  // namespace

// Compares a count with the threshold; a comparator's level is its own result.
void Lesense::evaluate(uint32_t data) {
    const uint32_t how = configured(CH0_EVAL), interact = configured(CH0_INTERACT);
    const uint32_t threshold = field(how, CH0_EVAL_COMPTHRES);
    bool hit = data;
    if (!(interact & CH0_INTERACT_SAMPLE))
        hit = how & CH0_EVAL_COMP ? data >= threshold : data < threshold;
    hit ^= !!(how & CH0_EVAL_SCANRESINV);
    const bool before = reg(SCANRES) >> channel & 1;
    set_bits(reg(SCANRES), 1u << channel, hit);
    part.prs->set(channel < 8 ? LOWER : UPPER, (int)channel % 8, hit);
    const uint32_t when = field(interact, CH0_INTERACT_SETIF);
    if ((when == LEVEL && hit) || (when == POSITIVE_EDGE && hit && !before) ||
        (when == NEGATIVE_EDGE && !hit && before))
        raise(1u << channel);
    if (how & CH0_EVAL_STRSAMPLE)
        store(data);
    if (how & CH0_EVAL_DECODE && sensor_count < 4)
        sensors |= (uint32_t)hit << sensor_count++;
}

void Lesense::store(uint32_t data) {
    if (results.full()) {
        raise(IF_BUFOF);
        if (!(reg(CTRL) & CTRL_BUFOW)) return;
    }
    reg(BUF0_DATA + 4 * results.push()) = data & 0xFFFF;
    const uint32_t level = reg(CTRL) & CTRL_BUFIDL ? ResultBuffer::ENTRIES
                                                   : ResultBuffer::ENTRIES / 2;
    raise(IF_BUFDATAV | (results.size() >= level ? IF_BUFLEVEL : 0u));
    if (results.size() >= level)
        part.dma->request(SOURCE, 0, true);
    follow();
}

uint32_t Lesense::decoder_input() const {
    if (!(reg(DECCTRL) & DECCTRL_INPUT)) return reg(SENSORSTATE);
    uint32_t input = 0;
    for (int n = 0; n < 4; n++)
        input |= (uint32_t)part.prs->level(
                     (int)(reg(DECCTRL) >> (10 + 4 * n) & 0xF)) << n;
    return input;
}

// Hysteresis suppresses what a step back to the previous state would signal.
void Lesense::decode(uint32_t input) {
    const Decision decision = decide(reg(DECSTATE), input, [this](uint32_t at) { return reg(at); });
    if (!decision.found) {
        if (reg(DECCTRL) & DECCTRL_ERRCHK && input != decoded)
            raise(IF_DECERR);
        return;
    }
    const uint32_t next = field(decision.transition, ST0_TCONFA_NEXTSTATE);
    const bool reversed = next == previous_state && next != decision.from;
    decoded = input;
    previous_state = decision.from;
    reg(DECSTATE) = next;
    pulse_decoder(field(decision.transition, ST0_TCONFA_PRSACT), reversed);
    if (reversed && reg(DECCTRL) & DECCTRL_HYSTIRQ) return;
    raise((decision.transition & ST0_TCONFA_SETIF ? IF_DEC : 0u) |
          (reg(DECCTRL) & DECCTRL_INTMAP ? 1u << decision.from : 0u));
}

void Lesense::pulse_decoder(uint32_t action, bool reversed) {
    const auto pulse = [&](int signal) {
        if (!(reversed && reg(DECCTRL) & DECCTRL_HYSTPRS0 << signal))
            part.prs->pulse(DECODER, signal);
    };
    if (reg(DECCTRL) & DECCTRL_PRSCNT) {
        const uint32_t count = action & 3;
        if (count) {
            part.prs->set(DECODER, 1, count == UP);
            pulse(0);
        }
        action &= 4;
    }
    for (int signal = 0; signal < 3; signal++)
        if (action >> signal & 1)
            pulse(signal);
}

void Lesense::follow() {
    if (!results.size())
        part.dma->request(SOURCE, 0, false);
    part.dma->wakes(SOURCE, reg(CTRL) & CTRL_DMAWU);
    update_interrupts();
}

}  // namespace efm32gg
