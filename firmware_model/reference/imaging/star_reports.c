/* SPDX-License-Identifier: BSD-2-Clause */
/* Telemetry of single stars; stepping frames return the next star at each read, and wrap. */
#include "star_reports.h"

#include "algorithms/catalogue.h"
#include "cubestar_tables.h"
#include "processing.h"

#define NOT_IDENTIFIED 0xFFFF
#define NO_STAR 0xFF
#define VECTOR_COUNTS 10000.0f /* StarDetails has vectors as plain counts */

/* Position of a stepping frame. */
struct cursor {
    unsigned generation;
    int next;
};

static int detected(void)
{
    return results.detected ? results.detection.count : 0;
}

static int identified(void)
{
    int count = 0;
    if (results.identified)
        for (int i = 0; i < results.identification.count; i++)
            count += results.identification.stars[i] != NO_IDENTITY;
    return count;
}

static int identity_of(int star)
{
    return results.identified && results.identification.stars[star] != NO_IDENTITY
               ? results.identification.stars[star]
               : NOT_IDENTIFIED;
}

static int votes_of(int star)
{
    return identity_of(star) == NOT_IDENTIFIED ? 0 : results.identification.votes[star];
}

static double confidence_of(int star)
{
    return identity_of(star) == NOT_IDENTIFIED
               ? 0
               : (double)confidence(&results.identification, star);
}

/* The next of `count` stars; new results start again. */
static int step(struct cursor *cursor, int count)
{
    int place = cursor->generation == results.generation ? cursor->next % count : 0;
    cursor->generation = results.generation;
    cursor->next = place + 1;
    return place;
}

/* The next detected star, -1 without one. */
static int next_detected(struct cursor *cursor)
{
    return detected() ? step(cursor, detected()) : -1;
}

static int next_identified(struct cursor *cursor)
{
    int count = identified();
    if (!count)
        return -1;
    int place = step(cursor, count), star = 0;
    while (identity_of(star) == NOT_IDENTIFIED || place-- > 0)
        star++;
    return star;
}

static void position(uint8_t *data)
{
    static struct cursor cursor;
    int star = next_detected(&cursor);
    PUT(StarPositions, StarNumber, star < 0 ? NO_STAR : star);
    if (star < 0)
        return;
    PUT(StarPositions, X_Coordinate, results.detection.centroids[star][0]);
    PUT(StarPositions, Y_Coordinate, results.detection.centroids[star][1]);
    PUT(StarPositions, X_CorrectedCoordinate, results.points[star][0]);
    PUT(StarPositions, Y_CorrectedCoordinate, results.points[star][1]);
    PUT(StarPositions, Size, results.detection.sizes[star]);
    PUT(StarPositions, Intensity, results.detection.intensities[star]);
}

static void body_vector(uint8_t *data)
{
    static struct cursor cursor;
    int star = next_detected(&cursor);
    PUT(BodyUnitVectors, StarNumber, star < 0 ? NO_STAR : star);
    if (star < 0)
        return;
    PUT(BodyUnitVectors, VbX, results.vectors[star][0]);
    PUT(BodyUnitVectors, VbY, results.vectors[star][1]);
    PUT(BodyUnitVectors, VbZ, results.vectors[star][2]);
}

static void details(uint8_t *data)
{
    static struct cursor cursor;
    int star = next_detected(&cursor);
    PUT(StarDetails, StarNumber, star < 0 ? NO_STAR : star);
    PUT(StarDetails, ID, star < 0 ? NOT_IDENTIFIED : identity_of(star));
    if (star < 0)
        return;
    PUT(StarDetails, CCx, results.points[star][0]);
    PUT(StarDetails, CCy, results.points[star][1]);
    PUT(StarDetails, Vbx, VECTOR_COUNTS * results.vectors[star][0]);
    PUT(StarDetails, Vby, VECTOR_COUNTS * results.vectors[star][1]);
    PUT(StarDetails, Vbz, VECTOR_COUNTS * results.vectors[star][2]);
    PUT(StarDetails, ValidationVote, votes_of(star));
    PUT(StarDetails, confidance, confidence_of(star));
}

static void identity(uint8_t *data)
{
    static struct cursor cursor;
    int star = next_identified(&cursor);
    PUT(IDStarsDetails, StarNumber, star < 0 ? NO_STAR : star);
    PUT(IDStarsDetails, Identity, star < 0 ? NOT_IDENTIFIED : identity_of(star));
    if (star < 0)
        return;
    PUT(IDStarsDetails, ValidationVotes, votes_of(star));
    PUT(IDStarsDetails, Confidence, 100 * confidence_of(star));
}

static void inertial_vector(uint8_t *data)
{
    static struct cursor cursor;
    int star = next_identified(&cursor);
    PUT(InertialUnitVectors, StarNumber, star < 0 ? NO_STAR : star);
    PUT(InertialUnitVectors, Identity, star < 0 ? NOT_IDENTIFIED : identity_of(star));
    if (star < 0)
        return;
    PUT(InertialUnitVectors, ViX, star_x[identity_of(star)]);
    PUT(InertialUnitVectors, ViY, star_y[identity_of(star)]);
    PUT(InertialUnitVectors, ViZ, star_z[identity_of(star)]);
    PUT(InertialUnitVectors, Confidence, 100 * confidence_of(star));
}

static void hipparcos(uint8_t *data)
{
    static struct cursor cursor;
    int star = next_identified(&cursor);
    PUT(HipparcosNumber, StarNumber, star < 0 ? NO_STAR : star);
    if (star < 0)
        return;
    PUT(HipparcosNumber, Hipparcos, star_hip[identity_of(star)]);
    PUT(HipparcosNumber, X, results.detection.centroids[star][0]);
    PUT(HipparcosNumber, Y, results.detection.centroids[star][1]);
}

static void match_summary(uint8_t *data)
{
    double sum = 0;
    int count = 0, most = 0;
    for (int star = 0; star < detected(); star++) {
        if (identity_of(star) == NOT_IDENTIFIED)
            continue;
        sum += confidence_of(star);
        most = votes_of(star) > most ? votes_of(star) : most;
        count++;
    }
    PUT(MatchSummary, Detected, detected());
    PUT(MatchSummary, Matched, count);
    PUT(MatchSummary, MeanConfidence, count ? sum / count : 0);
    PUT(MatchSummary, MaxVotes, most);
}

static void best(uint8_t *data)
{
    int chosen[3];
    for (int i = 0; i < 3; i++)
        chosen[i] = i < results.selected ? results.best[i] : NO_STAR;
    PUT(BestStarIndex, Star1Index, chosen[0]);
    PUT(BestStarIndex, Star2Index, chosen[1]);
    PUT(BestStarIndex, Star3Index, chosen[2]);
}

/* The three frames have one layout. */
static void selected(int number, uint8_t *data)
{
    int star = number < results.selected ? results.best[number] : -1;
    PUT(Star1Details, S1CatNum, star < 0 ? NOT_IDENTIFIED : identity_of(star));
    if (star < 0)
        return;
    PUT(Star1Details, S1CentX, results.detection.centroids[star][0]);
    PUT(Star1Details, S1CentY, results.detection.centroids[star][1]);
    PUT(Star1Details, S1Mag, results.detection.intensities[star]);
    PUT(Star1Details, S1VBX, results.vectors[star][0]);
    PUT(Star1Details, S1VBY, results.vectors[star][1]);
    PUT(Star1Details, S1VBZ, results.vectors[star][2]);
    PUT(Star1Details, S1VIX, star_x[identity_of(star)]);
    PUT(Star1Details, S1VIY, star_y[identity_of(star)]);
    PUT(Star1Details, S1VIZ, star_z[identity_of(star)]);
    PUT(Star1Details, S1Conf, 100 * confidence_of(star));
}

void star_report_fill(uint8_t id, uint8_t *data)
{
    switch (id) {
    case CUBESTAR_TLM_StarPositions:
        position(data);
        break;
    case CUBESTAR_TLM_BodyUnitVectors:
        body_vector(data);
        break;
    case CUBESTAR_TLM_NumIdStars:
        PUT(NumIdStars, numIdStars, identified());
        break;
    case CUBESTAR_TLM_IDStarsDetails:
        identity(data);
        break;
    case CUBESTAR_TLM_InertialUnitVectors:
        inertial_vector(data);
        break;
    case CUBESTAR_TLM_BestStarIndex:
        best(data);
        break;
    case CUBESTAR_TLM_Star1Details:
        selected(0, data);
        break;
    case CUBESTAR_TLM_Star2Details:
        selected(1, data);
        break;
    case CUBESTAR_TLM_Star3Details:
        selected(2, data);
        break;
    case CUBESTAR_TLM_StarDetails:
        details(data);
        break;
    case CUBESTAR_TLM_HipparcosNumber:
        hipparcos(data);
        break;
    case CUBESTAR_TLM_MatchSummary:
        match_summary(data);
        break;
    }
}
