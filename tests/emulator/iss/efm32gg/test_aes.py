"""Encryption accelerator against the vectors of FIPS 197 and NIST SP 800-38A."""

import random
from pathlib import Path

import pytest

from tests.emulator.iss.cross_compiler import needs_compiler

from .bench import MS, Bench, S, address_of, asleep, compiled, mask_of

HZ = 14_000_000
DECRYPT, AES256, KEYBUFEN, DATASTART, XORSTART, BYTEORDER = (
    mask_of(f"AES.CTRL.{name}")
    for name in ("DECRYPT", "AES256", "KEYBUFEN", "DATASTART", "XORSTART", "BYTEORDER")
)
AES_IRQ, DMA_SOURCE = 36, 49
DATA_WRITE, XORDATA_WRITE, DATA_READ = 0, 1, 2
RESULT = 0x2001_0000


def vector(*words: str) -> bytes:
    return bytes.fromhex("".join(words))


# FIPS 197: appendix B, then C.1 and C.3. Key, plain text, cipher text.
FIPS = [
    ("2b7e151628aed2a6abf7158809cf4f3c", "3243f6a8885a308d313198a2e0370734",
     "3925841d02dc09fbdc118597196a0b32"),
    ("000102030405060708090a0b0c0d0e0f", "00112233445566778899aabbccddeeff",
     "69c4e0d86a7b0430d8cdb78070b4c55a"),
    ("000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f",
     "00112233445566778899aabbccddeeff", "8ea2b7ca516745bfeafc49904b496089"),
]  # fmt: skip
# FIPS 197, A.1: the last round's key of appendix B.
LAST_ROUND_KEY = vector("d014f9a8c9ee2589e13f0cc8b6630ca6")
# SP 800-38A, F.2.1: CBC with the key of appendix B.
IV = bytes(range(16))
PLAIN = vector("6bc1bee22e409f96e93d7e117393172a", "ae2d8a571e03ac9c9eb76fac45af8e51",
               "30c81c46a35ce411e5fbc1191a0a52ef", "f69f2445df4f9b17ad2b417be66c3710")  # fmt: skip
CBC = vector("7649abac8119b246cee98e9b12e9197d", "5086cb9b507219ee95db113a917678b2",
             "73bed6b8e3c1743b7116e69e22229516", "3ff1caa1681fac09120eca307586e1a7")  # fmt: skip


class Aes(Bench):
    """The accelerator; ``words`` of 16 bytes are in the order of its registers."""

    def __init__(self, control: int = 0) -> None:
        super().__init__()
        self.clock("AES")
        self.control = control
        self["AES.CTRL"] = control

    def words(self, data: bytes) -> list[int]:
        if self.control & BYTEORDER:
            return [int.from_bytes(data[n : n + 4], "little") for n in range(0, 16, 4)]
        return [int.from_bytes(data[n : n + 4], "big") for n in range(12, -1, -4)]

    def put(self, name: str, data: bytes) -> None:
        for word in self.words(data):
            self[f"AES.{name}"] = word

    def get(self, name: str) -> bytes:
        words = [self[f"AES.{name}"] for _ in range(4)]
        if self.control & BYTEORDER:
            return b"".join(word.to_bytes(4, "little") for word in words)
        return b"".join(word.to_bytes(4, "big") for word in reversed(words))

    def put_key(self, key: bytes) -> None:
        """As the vendor's library: the first half of a long key is the upper one."""
        self.put("KEYLA", key[-16:])
        if len(key) == 32:
            self.put("KEYHA", key[:16])

    def run_block(self, data: bytes) -> bytes:
        self.put("DATA", data)
        if not self.control & DATASTART:
            self["AES.CMD"] = 1
        self.run_for(S // 100_000)
        assert not self.is_set("AES.STATUS.RUNNING")
        return self.get("DATA")


@pytest.mark.parametrize("order", [0, BYTEORDER])
@pytest.mark.parametrize("start", [0, DATASTART])
@pytest.mark.parametrize("case", FIPS)
def test_encrypts_the_standard_vectors(case: tuple[str, ...], start: int, order: int) -> None:
    key, plain, cipher = map(vector, case)
    bench = Aes(order | start | (AES256 if len(key) == 32 else 0))
    bench.put_key(key)
    assert bench.run_block(plain) == cipher


@pytest.mark.parametrize("order", [0, BYTEORDER])
@pytest.mark.parametrize("case", FIPS)
def test_decrypts_with_the_key_that_encryption_left(case: tuple[str, ...], order: int) -> None:
    key, plain, cipher = map(vector, case)
    wide = AES256 if len(key) == 32 else 0
    bench = Aes(order | wide)
    bench.put_key(key)
    bench.run_block(bytes(16))
    bench.control |= DECRYPT
    bench["AES.CTRL"] = bench.control
    assert bench.run_block(cipher) == plain
    left = (bench.get("KEYHA") if wide else b"") + bench.get("KEYLA")
    assert left == key


def test_key_register_has_the_last_round_key_after_encryption() -> None:
    bench = Aes()
    bench.put_key(vector(FIPS[0][0]))
    bench.run_block(bytes(16))
    assert bench.get("KEYLA") == LAST_ROUND_KEY


def test_key_buffer_is_loaded_at_each_start() -> None:
    key, plain, cipher = map(vector, FIPS[0])
    bench = Aes(KEYBUFEN | DATASTART)
    bench.put("KEYHA", key)
    assert [bench.run_block(plain) for _ in range(3)] == [cipher] * 3
    assert bench.get("KEYHA") == key


def test_all_addresses_of_a_key_access_the_same_register() -> None:
    bench = Aes()
    for name, word in zip(("KEYLA", "KEYLB", "KEYLC", "KEYLD"), (1, 2, 3, 4), strict=True):
        bench[f"AES.{name}"] = word
    assert [bench["AES.KEYLC"] for _ in range(5)] == [1, 2, 3, 4, 1]
    assert bench.peek("AES.KEYLA") == bench.peek("AES.KEYLA") == 2


def test_xordata_chains_blocks() -> None:
    bench = Aes(KEYBUFEN | XORSTART)
    bench.put("KEYHA", vector(FIPS[0][0]))
    bench.put("DATA", IV)
    found = b""
    for at in range(0, len(PLAIN), 16):
        bench.put("XORDATA", PLAIN[at : at + 16])
        bench.run_for(S // 100_000)
        found += bench.get("DATA")
    assert found == CBC


@pytest.mark.parametrize("wide", [0, AES256])
def test_random_blocks_come_back(wide: int) -> None:
    rng = random.Random(wide)
    bench = Aes(wide | BYTEORDER)
    for _ in range(20):
        key, plain = rng.randbytes(32 if wide else 16), rng.randbytes(16)
        bench.put_key(key)
        bench["AES.CTRL"] = bench.control
        cipher = bench.run_block(plain)
        bench["AES.CTRL"] = bench.control | DECRYPT
        assert bench.run_block(cipher) == plain


@pytest.mark.parametrize(("wide", "cycles"), [(0, 54), (AES256, 75)])
def test_block_takes_its_cycles_and_interrupts(wide: int, cycles: int) -> None:
    bench = asleep(1).clock("AES")
    bench.load("AES", CTRL=wide, IEN=1)
    end = bench.now + cycles * S // HZ
    bench["AES.CMD"] = 1
    bench.run_until(end - S // HZ - 1000)
    assert bench.peek("AES.STATUS")
    bench.run_until(end + 1000)
    assert not bench.peek("AES.STATUS")
    assert AES_IRQ in bench.pending()
    bench["AES.IFC"] = 1
    assert not bench["AES.IF"]


def test_stop_ends_a_block_without_a_result() -> None:
    bench = Aes()
    bench.put("DATA", IV)
    bench.load("AES", CMD=1).load("AES", CMD=2)
    bench.run_for(MS)
    assert (bench.get("DATA"), bench["AES.IF"]) == (IV, 0)


def test_write_while_running_is_lost_and_reported() -> None:
    bench = Aes()
    bench.load("AES", CMD=1, DATA=5)
    assert "while it runs" in bench.log()


def test_dma_reads_and_feeds_a_chain_of_blocks() -> None:
    """Results leave by channel 0, the next block enters by channel 1; software moves the first."""
    bench = Aes(KEYBUFEN | XORSTART | BYTEORDER)
    bench.put("KEYHA", vector(FIPS[0][0]))
    bench.put("DATA", IV)
    source, target = 0x2000_1000, 0x2000_2000
    bench.machine.poke(source, PLAIN)
    four_words = 2 << 24 | 2 << 14
    bench.dma(0, DMA_SOURCE << 16 | DATA_READ, address_of("AES.DATA"), target + 60,
              2 << 30 | 3 << 26 | four_words | 15 << 4 | 1)  # fmt: skip
    bench.dma(1, DMA_SOURCE << 16 | XORDATA_WRITE, source + 60, address_of("AES.XORDATA"),
              3 << 30 | 2 << 26 | four_words | 15 << 4 | 1)  # fmt: skip
    bench["DMA.CHSWREQ"] = 2
    bench.run_for(MS)
    assert bench.machine.peek(target, 64) == CBC


PROGRAM = """
static volatile int done;

void IRQ(void) {
    AES->IFC = AES_IFC_DONE;
    done = 1;
}

int main(void) {
    static const uint8_t key[16] __attribute__((aligned(4))) = {
        0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_AES;
    AES->CTRL = AES_CTRL_KEYBUFEN | AES_CTRL_DATASTART;
    AES->IEN = AES_IEN_DONE;
    *(volatile uint32_t *)0xE000E104 = 1u << (AES_IRQ - 32);
    for (int n = 3; n >= 0; n--)
        AES->KEYHA = __builtin_bswap32(((const uint32_t *)key)[n]);
    for (int n = 3; n >= 0; n--)
        AES->DATA = 0x00112233u + 4u * (uint32_t)n * 0x11111111u;
    while (!done)
        __asm volatile("wfi");
    for (int n = 3; n >= 0; n--)
        RESULT[n] = __builtin_bswap32(AES->DATA);
    return 0;
}
"""


@needs_compiler
def test_compiled_program_encrypts_by_interrupt(tmp_path: Path) -> None:
    bench = Bench(image=compiled(PROGRAM, tmp_path))
    bench.run_for(MS)
    assert bench.machine.peek(RESULT, 16) == vector(FIPS[1][2])
