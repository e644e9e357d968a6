#include "armv7m/debug/itm.h"

namespace armv7m {

void Itm::reset() {
    control = ports = privilege = 0;
    unlocked = false;
}

void Itm::enable_all() {
    control = 1;
    ports = ~0u;
    unlocked = true;
}

uint32_t Itm::read(uint32_t offset) const {
    if (offset < 0x80) return 1;    // FIFOREADY
    switch (offset) {
    case TER: return ports;
    case TPR: return privilege;
    case TCR: return control;
    case LSR: return unlocked ? 1 : 3;
    default: return 0;
    }
}

void Itm::write(uint32_t offset, uint32_t value) {
    if (offset == LAR) unlocked = value == 0xC5ACCE55;
    if (!unlocked) return;
    switch (offset) {
    case TER: ports = value; break;
    case TPR: privilege = value & 15; break;
    case TCR: control = value & 0x007F0F1F; break;
    }
}

}  // namespace armv7m
