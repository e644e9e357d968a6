/* SPDX-License-Identifier: BSD-2-Clause */
/* Frames on the UART, decoded as in firmware_model/interface/codec/frames.py. */
#include "frames.h"

#define ESCAPE 0x1F
#define START 0x7F
#define END 0xFF

enum frame_event frame_feed(struct frame_decoder *decoder, uint8_t byte)
{
    bool inside = decoder->inside, escaped = decoder->escaped;
    decoder->escaped = !escaped && byte == ESCAPE;
    if (decoder->escaped)
        return FRAME_NOTHING;
    if (!escaped || byte == ESCAPE) {
        if (inside) {
            if (decoder->length < LONGEST_PAYLOAD)
                decoder->payload[decoder->length++] = byte;
            return FRAME_NOTHING;
        }
        decoder->escaped = escaped; /* after 1F 1F the second one may still begin a frame */
        return FRAME_PROTOCOL_ERROR;
    }
    decoder->inside = byte == START;
    if (byte == START) {
        decoder->length = 0;
        return inside ? FRAME_INCOMPLETE : FRAME_NOTHING;
    }
    return byte == END && inside ? FRAME_WHOLE : FRAME_PROTOCOL_ERROR;
}

bool frame_unfinished(const struct frame_decoder *decoder)
{
    return decoder->inside || decoder->escaped;
}

bool frame_reset(struct frame_decoder *decoder)
{
    bool unfinished = frame_unfinished(decoder);
    decoder->inside = decoder->escaped = false;
    return unfinished;
}

int frame_encode(uint8_t *frame, const uint8_t *payload, int count)
{
    int end = 0;
    frame[end++] = ESCAPE;
    frame[end++] = START;
    for (int i = 0; i < count; i++) {
        if (payload[i] == ESCAPE)
            frame[end++] = ESCAPE;
        frame[end++] = payload[i];
    }
    frame[end++] = ESCAPE;
    frame[end++] = END;
    return end;
}
