// The C++ SRAM alone, for a test that drives it beside the Python one.
#include "sram_model.h"

extern "C" {

Sram *sram_new(uint8_t *memory, const SramTiming *timing, int64_t keep) {
    return new Sram(memory, *timing, keep);
}

void sram_delete(Sram *sram) { delete sram; }

void sram_drive(Sram *sram, int64_t time, uint32_t address, bool ce_n, bool oe_n, bool we_n,
                bool driven, uint8_t data) {
    sram->drive(time, SramPins(address, ce_n, oe_n, we_n, driven, data));
}

uint8_t sram_sample(Sram *sram, int64_t time) {
    sram->sample(time);
    return sram->bus();
}

int64_t sram_kept(const Sram *sram) { return (int64_t)sram->kept.size(); }

const Violation *sram_violations(const Sram *sram) { return sram->kept.data(); }

int64_t sram_count(const Sram *sram, int32_t kind) { return sram->counts[kind]; }

}
