// Finds and decodes code: in regions with decoded operations, or single instructions elsewhere.

#include "armv7m/core/cpu.h"
#include "armv7m/decode/decode.h"
#include "armv7m/system/system.h"

#include <algorithm>
#include <cstring>

namespace armv7m {

// Prepares the loop for code at `pc`. False: call fetch_failed().
bool Cpu::find_code(uint32_t pc) {
    lines = nullptr;
    guarded = system->mpu.enabled();
    fetch_fault = Fault::FetchViolation;
    if (Mpu::execute_never(pc)) return false;
    if (guarded && !system->mpu.allows(pc, Access::Fetch, privileged())) return false;
    const Region *region = find_region(pc, 2);
    if (region == nullptr || !region->readable) {
        return run_aside(pc);
    }
    Code &code = code_of(*region);
    if (code.base != region->base || code.lines != region->lines) {
        code.base = region->base, code.lines = region->lines;
        fetch_again(code);
    }
    operations = home = code.operations.get();
    code_base = home_base = region->base, code_size = region->size, home_size = code.size;
    lines = region->lines;
    return true;
}

// Decodes a single instruction, followed by markers at which the loop returns.
bool Cpu::run_aside(uint32_t pc) {
    const Region *region = find_region(pc, 2);
    uint32_t first, second = 0;
    fetch_fault = Fault::FetchBus;
    if (!fetch_half(pc, first)) return false;
    if (is_wide(first) && !fetch_half(pc + 2, second)) return false;
    aside[0] = is_wide(first) ? decode_32(first, second) : decode_16(first);
    aside[0].entry = C_FETCH;
    aside[1].mark(C_REGION_END), aside[2].mark(C_REGION_END);
    if (region != nullptr) {    // same timing as in place
        const uint32_t offset = pc - region->base;
        aside[0].stall = address_stall(aside[0], region->host, offset) & 1;
        if (aside[0].code == C_IT)
            aside[0].a = folds(offset, code_of(*region).operations.get() + offset / 2);
    }
    operations = aside;
    code_base = pc, code_size = 0;    // every branch leaves
    return true;
}

bool Cpu::fetch_half(uint32_t address, uint32_t &value) {
    const Region *region = find_region(address, 2);
    if (region == nullptr || !region->readable) return bus.fetch_halfword(address, value);
    value = 0;
    std::memcpy(&value, region->host + (address - region->base), 2);
    return true;
}

void Cpu::fetch_failed() {
    system->fault(fetch_fault, r[15]);
    attention_requested = true;
}

// Decodes the operation at `pc` in the current region. False: its second half lies outside; it must
// run aside.
bool Cpu::decode_at(uint32_t pc, Operation *op) {
    const uint32_t offset = pc - code_base;
    for (const Code &code : codes) {
        if (code.operations.get() != operations) continue;
        uint16_t halves[2] = {0, 0};
        std::memcpy(halves, code.host + offset, offset + 4 <= code_size ? 4 : 2);
        if (is_wide(halves[0]) && offset + 4 > code_size) return false;
        *op = is_wide(halves[0]) ? decode_32(halves[0], halves[1]) : decode_16(halves[0]);
        op->stall = address_stall(*op, code.host, offset) & 1;
        op->across = op->halves == 2 && pc & 2;
        op->entry = lines ? (uint16_t)C_FETCH : op->handler();
        code.marks[offset >> 6] = code.marks[(offset + op->halves * 2 - 1) >> 6] = 1;
        if (!breakpoints.empty() && breakpoint_at(pc)) op->mark(C_BREAK);
        return true;
    }
    return false;
}

// Does the loop's work at the target of a branch that left the loop: a 32-bit instruction across
// two words costs one cycle more, and the refill hides a stall.
void Cpu::arrive() {
    const bool odd = arriving == ArrivingOdd;
    if (arriving == NotArriving) return;
    arriving = NotArriving;
    Operation *op = operations + ((r[15] - code_base) >> 1);
    if (op->code == C_UNDECODED && !decode_at(r[15], op)) return;
    if (odd && op->halves == 2) cycles++;
    cycles -= op->stall;
}

// Whether the MPU lets the program fetch this instruction.
bool Cpu::may_fetch(uint32_t pc, uint32_t halves) {
    fetch_fault = Fault::FetchViolation;
    for (uint32_t address = pc; address != pc + 2 * halves; address += 2)
        if (!system->mpu.allows(address, Access::Fetch, privileged())) return false;
    return true;
}

// The fetch of all that is decoded there may cost something.
void Cpu::fetch_again(Code &code) {
    for (uint32_t offset = 0; offset < code.size; offset += 64) {
        uint64_t eight;    // marks; most are 0
        if (offset % 512 == 0 && code.size - offset >= 512) {
            std::memcpy(&eight, &code.marks[offset >> 6], 8);
            if (eight == 0) {
                offset += 448;
                continue;
            }
        }
        if (!code.marks[offset >> 6]) continue;
        Operation *op = code.operations.get() + offset / 2;
        for (uint32_t left = std::min(code.size - offset, 64u) / 2; left != 0; left--, op++)
            if (op->entry > LAST_MARKER) op->entry = C_FETCH;
    }
}

void Cpu::lines_changed() {
    for (Code &code : codes)
        if (code.lines != nullptr) fetch_again(code);
}

}  // namespace armv7m
