// The C++ SRAM alone, for a test that drives it beside the Python one.
#include "sram_model.h"

struct Harness {
    Harness(uint8_t *memory, const SramTiming &timing, int64_t keep)
        : log(keep), sram(memory, timing, log, 0) {}

    ViolationLog log;
    Sram sram;
};

extern "C" {

Harness *sram_new(uint8_t *memory, const SramTiming *timing, int64_t keep) {
    return new Harness(memory, *timing, keep);
}

void sram_delete(Harness *harness) { delete harness; }

void sram_power(Harness *harness, bool on) { harness->sram.power(on); }

void sram_drive(Harness *harness, int64_t time, uint32_t address, bool ce_n, bool oe_n, bool we_n,
                bool driven, uint8_t data) {
    harness->sram.drive(time, SramPins(address, ce_n, oe_n, we_n, driven, data));
}

uint8_t sram_sample(Harness *harness, int64_t time) {
    harness->sram.sample(time);
    return harness->sram.bus();
}

int64_t sram_kept(const Harness *harness) { return (int64_t)harness->log.kept.size(); }

const Violation *sram_violations(const Harness *harness) { return harness->log.kept.data(); }

int64_t sram_count(const Harness *harness, int32_t kind) { return harness->log.counts[kind]; }

}
