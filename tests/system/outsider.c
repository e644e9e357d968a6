/* All published telemetry of a CubeStar or a CubeSense over a serial port, one NAME=VALUE a line.
 *
 *   cc -o outsider outsider.c && outsider /dev/ttyUSB0 cubestar
 *
 * Written from the published tables alone, as somebody would who has never seen this project's:
 * IDs, lengths, bit offsets, types and divisors are those that the tables print. A frame is 1F 7F,
 * payload with every 1F doubled, 1F FF. Records that a node hands out one by one are read as often
 * as there are stars. It says of a frame that it gets no answer, or one of another length.
 */
#define _DEFAULT_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

struct frame {
    int id, length;
    const char *fields; /* name@bit:type/divisor */
};

static const struct frame CUBESTAR[] = {
    {128, 8,
     "NodeType@0:u8 InterfaceVersion@8:u8 FirmwareVersionMajor@16:u8 "
     "FirmwareVersionMinor@24:u8 RuntimeMilliseconds@32:u16 RuntimeSeconds@48:u16"},
    {129, 11,
     "SerialNumber@0:u16 Temperature@16:i16/100 ResetCause@32:enum8 WDGResetCount@40:u16 "
     "TcmdCount@56:u16 TlmCount@72:u16"},
    {130, 10,
     "OverCurrent@0:bool1 UnderCurrent@1:bool1 UART_ProtocolError@8:bool1 "
     "UART_TcmdBufOfError@9:bool1 UART_Tcmd_TooManyParm@10:bool1 UART_Tcmd_TooFewParm@11:bool1 "
     "UART_MsgIncomplete@12:bool1 UART_RXTimeout@13:bool1 "
     "I2C_WaitForIDReadRequestError@16:bool1 I2C_TcmdBufOFError@17:bool1 "
     "I2C_TCMD_TooFewParm@18:bool1 I2C_TCMD_TooManyparm@19:bool1 SPICommsError@24:bool1 "
     "StatusError@25:bool1 ISSetupError@26:bool1 TestPatternConfigError@27:bool1 "
     "ImageCaptureError@28:bool1 ISDisableError@29:bool1 ConfigChangeError@30:bool1 "
     "ISEnableError@31:bool1 FocalLengthRangeError@32:bool1 PrincipalPointRangeError@33:bool1 "
     "ImageBlockSizeError@40:bool1 TimingError@41:bool1 TcmdIDError@42:bool1 "
     "TlmIDError@43:bool1 TriggerAlreadySet@44:bool1 TimerAlreadyRunning@45:bool1 "
     "DelayTimeSetToLong@46:bool1 StarPixSetError@48:bool1 MaxStarsSetError@49:bool1 "
     "MaxStarsDetection@50:bool1 MaxInvalidStarsDetectionError@51:bool1 "
     "CentroidingGridSizeSetError@52:bool1 ValidImageRangeSetError@53:bool1 "
     "MaxNoiseSetError@54:bool1 MaxNoiseDetected@55:bool1 SetIDModeError@56:bool1 "
     "IDModeError@57:bool1 ReducedIDListSizeError@58:bool1 LessThanThreeStarsInFoV@59:bool1 "
     "LessThanThreeStarsDetected@60:bool1 LessThanThreeStarsID@61:bool1 IDError@62:bool1 "
     "IDSearchError@63:bool1 DeclinationSetError@64:bool1 RightAscensionSetError@65:bool1 "
     "QuestindexError@66:bool1 RateExceeded@67:bool1 FlashInvalidAreaError@72:bool1 "
     "FlashLockedError@73:bool1 FlashTimeoutError@74:bool1 FlashUnalignedError@75:bool1"},
    {131, 1, "Processed@0:u8"},
    {132, 1, "taskStatus@0:enum8"},
    {133, 6, "StartupTime@0:u16 LoopTime@16:u16 MaxLoopTime@32:u16"},
    {134, 1, "TestResult@0:u8"},
    {135, 7, "Status@0:u8 Current@8:u16 MaxCurrent@24:u16 MinCurrent@40:u16"},
    {136, 2, "exposure@0:u16"},
    {137, 6, "FirstLine@0:u16 Width@16:u16 Height@32:u16"},
    {138, 14,
     "Line@0:u16 Misc1@16:u16 Misc2@32:u16 Clock@48:u16 Chain@64:u16 Ctrl@80:u16 Clamp@96:u16"},
    {139, 12, "FocalLength@0:f32 Fx@32:f32 Fy@64:f32"},
    {140, 8, "Cx@0:f32 Cy@32:f32"},
    {141, 16, "K1@0:f32 K2@32:f32 P1@64:f32 P2@96:f32"},
    {142, 2, "DataH@0:u8 DataL@8:u8"},
    {143, 128, "Block@0:bytes1024"},
    {144, 6, "SetupTime@0:u16 ExposureUpdateTime@16:u16 CaptureTime@32:u16"},
    {145, 9, "StepSize@0:u8 Xstart@8:u16 Xend@24:u16 Ystart@40:u16 Yend@56:u16"},
    {146, 3, "DarkThreshold@0:u8 DetectionThreshold@8:u8 StarThreshold@16:u8"},
    {147, 2, "MinPixels@0:u8 MaxPixels@8:u8"},
    {148, 1, "GridSize@0:u8"},
    {149, 3, "maxStars@0:u8 maxInvalidStars@8:u8 maxNoise@16:u8"},
    {150, 4, "NumStarsDetected@0:u8 NumInvalidStars@8:u8 AmountOfNoise@16:u8 ImageDarkValue@24:u8"},
    {151, 20,
     "X_Coordinate@0:f32 Y_Coordinate@32:f32 X_CorrectedCoordinate@64:f32 "
     "Y_CorrectedCoordinate@96:f32 StarNumber@128:u8 Size@136:u8 Intensity@144:u16"},
    {152, 7, "VbX@0:i16/10000 VbY@16:i16/10000 VbZ@32:i16/10000 StarNumber@48:u8"},
    {153, 8,
     "MaxStarSearchTime@0:u16 MaxCentroidFindTime@16:u16 MaxCorrectionTime@32:u16 "
     "MaxVectorCalTime@48:u16"},
    {154, 4, "StarDetectionTime@0:u16 MaxStarDetectionTime@16:u16"},
    {155, 1, "Mode@0:enum8"},
    {156, 1, "Margin@0:u8/10000"},
    {157, 1, "numIdStars@0:u8"},
    {158, 5, "StarNumber@0:u8 Identity@8:u16 ValidationVotes@24:u8 Confidence@32:u8"},
    {159, 10,
     "ViX@0:i16/10000 ViY@16:i16/10000 ViZ@32:i16/10000 StarNumber@48:u8 Identity@56:u16 "
     "Confidence@72:u8"},
    {160, 8,
     "MaxModeSelectionTime@0:u16 MaxDistanceCalTime@16:u16 MaxVoteRoundOneTime@32:u16 "
     "MaxFindIDTime@48:u16"},
    {161, 6, "MaxVoteRoundTwoTime@0:u16 MaxSelectID@16:u16 MaxAlgoCompletionTime@32:u16"},
    {162, 4, "StarIdentificationTime@0:u16 MaxStarIdentificationTime@16:u16"},
    {163, 4, "LatestTime@0:u16 MaxTime@16:u16"},
    {164, 8, "Qbar0@0:i16/10000 Qbar1@16:i16/10000 Qbar2@32:i16/10000 Qbar3@48:i16/10000"},
    {165, 8, "Declination@0:f32 RightAscension@32:f32"},
    {166, 4, "LatestTime@0:u16 MaxTime@16:u16"},
    {167, 7,
     "NumStarsDetected@0:u8 StarImageNoise@8:u8 InvalidStars@16:u8 NumberOfStarsID@24:u8 "
     "Idmode@32:enum8 ImageDarkValue@40:u8 ImageCaptureSuccess@48:bool1 "
     "DetectionSuccess@49:bool1 IdentificationSuccess@50:bool1 AttitudeSuccess@51:bool1 "
     "ProcessingTimeError@52:bool1 MaxStarsDetected@53:bool1 LessThanThreeStarsInFoV@54:bool1 "
     "CommsError@55:bool1"},
    {168, 6, "ImageCaptureTime@0:u16 DetectionTime@16:u16 IdentificationTime@32:u16"},
    {169, 3, "Star1Index@0:u8 Star2Index@8:u8 Star3Index@16:u8"},
    {170, 21,
     "S1CentX@0:u16 S1CentY@16:u16 S1Mag@32:u16 S1VBX@48:i16/10000 S1VBY@64:i16/10000 "
     "S1VBZ@80:i16/10000 S1VIX@96:i16/10000 S1VIY@112:i16/10000 S1VIZ@128:i16/10000 "
     "S1Conf@144:u8 S1CatNum@152:u16"},
    {171, 21,
     "S2CentX@0:u16 S2CentY@16:u16 S2Mag@32:u16 S2VBX@48:i16/10000 S2VBY@64:i16/10000 "
     "S2VBZ@80:i16/10000 S2VIX@96:i16/10000 S2VIY@112:i16/10000 S2VIZ@128:i16/10000 "
     "S2Conf@144:u8 S2CatNum@152:u16"},
    {172, 21,
     "S3CentX@0:u16 S3CentY@16:u16 S3Mag@32:u16 S3VBX@48:i16/10000 S3VBY@64:i16/10000 "
     "S3VBZ@80:i16/10000 S3VIX@96:i16/10000 S3VIY@112:i16/10000 S3VIZ@128:i16/10000 "
     "S3Conf@144:u8 S3CatNum@152:u16"},
    {173, 1, "Timeout@0:u8"},
    {174, 26,
     "Temp@0:i16/100 Runtime@16:u32 WDGcounter@48:u16 Status@64:enum8 SW@72:u8 Current@80:u16 "
     "MaxCurrent@96:u16 MinCurrent@112:u16 OverCurrent@128:bool1 UnderCurrent@129:bool1 "
     "UART_ProtocolError@136:bool1 UART_TcmdBufOfError@137:bool1 "
     "UART_Tcmd_TooManyParm@138:bool1 UART_Tcmd_TooFewParm@139:bool1 "
     "UART_MsgIncomplete@140:bool1 UART_RXTimeout@141:bool1 "
     "I2C_WaitForIDReadRequestError@144:bool1 I2C_TcmdBufOFError@145:bool1 "
     "I2C_TCMD_TooFewParm@146:bool1 I2C_TCMD_TooManyparm@147:bool1 SPICommsError@152:bool1 "
     "StatusError@153:bool1 ISsetupError@154:bool1 TestpatternConfigError@155:bool1 "
     "ImageCaptureError@156:bool1 ISDisableError@157:bool1 ConfigChangeError@158:bool1 "
     "ISEnableError@159:bool1 FocalLengthRangeError@160:bool1 BoresightRangeError@161:bool1 "
     "ImageBlockSizeError@168:bool1 MainLoopTimeError@169:bool1 TcmdIDError@170:bool1 "
     "TlmIDError@171:bool1 TriggerAlreadySet@172:bool1 TimerAlreadyRunning@173:bool1 "
     "TimerTimeSetToLong@174:bool1 PixSetError@176:bool1 MaxStarsSetError@177:bool1 "
     "MaxStarsDetection@178:bool1 MaxInvalidStarsDetectionError@179:bool1 "
     "CentroidingGridSizeSetError@180:bool1 ValidImageRangeSetError@181:bool1 "
     "MaxNoiseSetError@182:bool1 MaxNoiseDetected@183:bool1 SetIDModeError@184:bool1 "
     "IDModeError@185:bool1 ReducedIDListSizeError@186:bool1 LessThanThreeStarsInFoV@187:bool1 "
     "LessThanThreeStarsDetected@188:bool1 LessThanThreeStarsID@189:bool1 IDError@190:bool1 "
     "IDSearchError@191:bool1 DeclinationSetError@192:bool1 RightAscensionSetError@193:bool1 "
     "QuestindexError@194:bool1 RateExceeded@195:bool1 FlashInvalidAreaError@200:bool1 "
     "FlashLockedError@201:bool1 FlashTimeoutError@202:bool1 FlashUnalignedError@203:bool1"},
    {175, 6, "DarkValue@0:u8 Detected@8:u8 Invalid@16:u8 Noise@24:u8 IDMode@32:u8 ID@40:u8"},
    {176, 22,
     "StarNumber@0:u8 CCx@8:f32 CCy@40:f32 Vbx@72:i16 Vby@88:i16 Vbz@104:i16 ID@120:u16 "
     "ValidationVote@136:u8 confidance@144:f32"},
    {177, 18,
     "Qbar0@0:i16/10000 Qbar1@16:i16/10000 Qbar2@32:i16/10000 Qbar3@48:i16/10000 "
     "RightAscension@64:i16/10000 Declination@80:i16/10000 BSVX@96:i16/10000 "
     "BSVY@112:i16/10000 BSVZ@128:i16/10000"},    {0, 0, NULL}};

static const struct frame CUBESENSE[] = {
    {0x80, 8, "node@0:u8 interface@8:u8 major@16:u8 minor@24:u8 uptime_s@32:u16 uptime_ms@48:u16"},
    {0x81, 6, "serial@0:bytes48"},
    {0x82, 8, "tc_count@0:u16 tlm_count@16:u16 overrun@32:u8 i2c_error@40:u8 protocol_error@48:u8 "
              "incomplete@56:u8"},
    {0x83, 3, "last_tc@0:u8 processed@8:u8 error@16:u8"},
    {0x94, 6, "alpha@0:i16/100 beta@16:i16/100 capture@32:u8 detect@40:u8"},
    {0x95, 6, "alpha@0:i16/100 beta@16:i16/100 capture@32:u8 detect@40:u8"},
    {0x96, 6, "alpha@0:i16/100 beta@16:i16/100 capture@32:u8 detect@40:u8"},
    {0x97, 6, "alpha@0:i16/100 beta@16:i16/100 capture@32:u8 detect@40:u8"},
    {0x98, 6, "alpha@0:i16/100 beta@16:i16/100 capture@32:u8 detect@40:u8"},
    {0x99, 6, "alpha@0:i16/100 beta@16:i16/100 capture@32:u8 detect@40:u8"},
    {0x9A, 10, "i3v3@0:u16/10 sram1@16:u16/10 sram2@32:u16/10 i5v@48:u16/10 flag1@64:u8 "
               "flag2@72:u8"},
    {0xA8, 14, "thr1@0:u8 thr2@8:u8 auto1@16:u8 exp1@24:u16 gain1@40:u8 blue1@48:u8 red1@56:u8 "
               "auto2@64:u8 exp2@72:u16 gain2@88:u8 blue2@96:u8 red2@104:u8"},
    {0xC0, 128, "frame@0:bytes1024"},
    {0xC1, 3, "number@0:u16 checksum@16:u8"},
#define AREA(n, at) #n "xmin@" #at "+0:u16 " #n "xmax@" #at "+16:u16 " \
                    #n "ymin@" #at "+32:u16 " #n "ymax@" #at "+48:u16 "
    {0xC8, 40, AREA(1, 0) AREA(2, 64) AREA(3, 128) AREA(4, 192) AREA(5, 256)},
    {0xC9, 40, AREA(1, 0) AREA(2, 64) AREA(3, 128) AREA(4, 192) AREA(5, 256)},
    {0, 0, NULL}};

static int exchange(int port, uint8_t id, uint8_t *data) {
    uint8_t request[] = {0x1F, 0x7F, id, 0x1F, 0xFF}, byte;
    int inside = 0, escaped = 0, length = 0;
    if (write(port, request, sizeof request) != sizeof request)
        return -1;
    for (;;) {
        struct pollfd waiting = {.fd = port, .events = POLLIN};
        if (poll(&waiting, 1, 500) <= 0 || read(port, &byte, 1) != 1)
            return -1;
        if (!escaped && byte == 0x1F) {
            escaped = 1;
            continue;
        }
        if (escaped && byte == 0x7F) {
            inside = 1;
            length = 0;
        } else if (escaped && byte == 0xFF) {
            return length;
        } else if (inside && length < 256) {
            data[length++] = byte;
        }
        escaped = 0;
    }
}

static uint32_t raw_of(const uint8_t *data, int bit, int bits) {
    uint32_t raw = 0;
    for (int index = 0; index < bits; index++, bit++)
        raw |= (uint32_t)(data[bit / 8] >> bit % 8 & 1) << index;
    return raw;
}

static void show(int id, const char *field, const uint8_t *data) {
    const char *at = strchr(field, '@'), *type = strchr(field, ':') + 1;
    char *rest;
    int bit = (int)strtol(at + 1, &rest, 10);
    if (*rest == '+')
        bit += (int)strtol(rest + 1, NULL, 10);
    printf("%d.%.*s=", id, (int)(at - field), field);
    if (strncmp(type, "bytes", 5) == 0) {
        for (int end = bit + atoi(type + 5); bit < end; bit += 8)
            printf("%02x", data[bit / 8]);
    } else if (strncmp(type, "f32", 3) == 0) {
        const uint32_t raw = raw_of(data, bit, 32);
        float value;
        memcpy(&value, &raw, sizeof value);
        printf("%.9g", value);
    } else {
        const int bits = atoi(type + strcspn(type, "0123456789"));
        const uint32_t raw = raw_of(data, bit, bits);
        const char *divisor = strpbrk(type, "/ ");
        const double number = *type == 'i' ? (double)(int16_t)raw : (double)raw;
        printf("%.10g", divisor && *divisor == '/' ? number / atof(divisor + 1) : number);
    }
    putchar('\n');
}

static void print_frame(int port, const struct frame *frame) {
    uint8_t data[256];
    const int length = exchange(port, (uint8_t)frame->id, data);
    if (length != frame->length) {
        printf("%d: %s\n", frame->id, length < 0 ? "no answer" : "wrong length");
        return;
    }
    for (const char *field = frame->fields; field && *field; field += strspn(field, " ")) {
        show(frame->id, field, data);
        field += strcspn(field, " ");
    }
}

/* A camera's result until its capture and its detection are no longer pending. */
static void settle(int port, int id) {
    uint8_t data[256] = {0};
    do
        usleep(1000);
    while (exchange(port, (uint8_t)id, data) == 6 && (data[4] == 1 || data[5] == 2));
}

int main(int count, char **arguments) {
    const int star = count == 3 && strcmp(arguments[2], "cubestar") == 0;
    const int port = count == 3 ? open(arguments[1], O_RDWR | O_NOCTTY) : -1;
    struct termios settings;
    uint8_t data[256] = {0};
    if (port < 0 || tcgetattr(port, &settings) < 0)
        return 1;
    cfmakeraw(&settings);
    cfsetspeed(&settings, B57600);
    tcsetattr(port, TCSANOW, &settings);
    const int detected = star && exchange(port, 150, data) == 4 ? data[0] : 0;
    const int identified = star && exchange(port, 157, data) == 1 ? data[0] : 0;
    for (const struct frame *frame = star ? CUBESTAR : CUBESENSE; frame->id; frame++) {
        const int id = frame->id;
        int records = 1;
        if (star && (id == 151 || id == 152 || id == 176))
            records = detected;
        if (star && (id == 158 || id == 159))
            records = identified;
        for (int record = 0; record < records; record++)
            print_frame(port, frame);
        if (!star && id >= 0x96 && id <= 0x99)
            settle(port, id % 2 ? 0x95 : 0x94);
    }
    return 0;
}
