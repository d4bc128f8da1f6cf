/* Opens the golden streams through the C functions and compares their Gaussians, bit by bit, with tests/golden-streams/frames.txt,
 * and the takes of tests/conformance with the checksums there; refuses damaged ones; draws pictures.
 * usage: golden FOLDER_OF_GOLDEN_STREAMS */
#include "light4gs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: %s; last error: %s\n", __FILE__, __LINE__, #condition, l4gs_last_error());        \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* CRC-32C, bit by bit. */
static uint32_t crc(uint32_t sum, const void *data, size_t bytes) {
    const unsigned char *byte = data;
    sum = ~sum;
    for (size_t i = 0; i < bytes; i++) {
        sum ^= byte[i];
        for (int bit = 0; bit < 8; bit++) {
            sum = sum >> 1 ^ (sum & 1 ? 0x82F63B78u : 0);
        }
    }
    return ~sum;
}

static float *floats(size_t count) {
    float *array = calloc(count ? count : 1, sizeof(float));
    CHECK(array);
    return array;
}

static unsigned char *read_file(const char *path, size_t *length) {
    FILE *file = fopen(path, "rb");
    CHECK(file);
    CHECK(fseek(file, 0, SEEK_END) == 0);
    *length = (size_t)ftell(file);
    rewind(file);
    unsigned char *bytes = malloc(*length);
    CHECK(bytes && fread(bytes, 1, *length, file) == *length);
    fclose(file);
    return bytes;
}

/* Arrays with room for n Gaussians with so many coefficients after the first. */
static L4gsInriaArrays inria_arrays(size_t n, size_t rest) {
    L4gsInriaArrays a = {floats(3 * n), floats(3 * n), floats(3 * rest * n), floats(n), floats(3 * n), floats(4 * n)};
    return a;
}

/* The checksum of the arrays, which it frees, in the order of docs/format.md. */
static uint32_t checksum_of(L4gsInriaArrays a, size_t n, size_t rest) {
    /* From red, green, blue behind each other to side by side. */
    float *sh = floats(3 * rest * n);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < rest; k++) {
            for (size_t c = 0; c < 3; c++) {
                sh[3 * (rest * i + k) + c] = a.f_rest[3 * rest * i + rest * c + k];
            }
        }
    }
    uint32_t sum = 0;
    sum = crc(sum, a.means, 3 * n * sizeof(float));
    sum = crc(sum, a.scale, 3 * n * sizeof(float));
    sum = crc(sum, a.rot, 4 * n * sizeof(float));
    sum = crc(sum, a.opacity, n * sizeof(float));
    sum = crc(sum, a.f_dc, 3 * n * sizeof(float));
    sum = crc(sum, sh, 3 * rest * n * sizeof(float));
    free(a.means), free(a.f_dc), free(a.f_rest), free(a.opacity), free(a.scale), free(a.rot), free(sh);
    return sum;
}

/* The checksum of all attributes of a scene at a time. */
static uint32_t checksum_at(const L4gsScene *scene, float time) {
    L4gsInfo info;
    CHECK(l4gs_info(scene, &info) == L4GS_STATUS_OK);
    size_t n = info.gaussians, rest = info.sh_coefficients - 1;
    L4gsInriaArrays a = inria_arrays(n, rest);
    CHECK(l4gs_gaussians_inria(scene, time, n, &a) == L4GS_STATUS_OK);
    uint32_t sum = checksum_of(a, n, rest);
    for (uint32_t i = 0; i < info.attributes; i++) {
        const char *name;
        const float *values;
        uint32_t width;
        CHECK(l4gs_attribute(scene, i, &name, &width, &values) == L4GS_STATUS_OK && strlen(name) > 0);
        sum = crc(sum, values, width * n * sizeof(float));
    }
    return sum;
}

/* The checksum of all attributes of a take at a time. */
static uint32_t checksum_of_take(const L4gsTake *take, double seconds) {
    L4gsGaussians *gaussians;
    L4gsCounts counts;
    CHECK(l4gs_take_gaussians(take, seconds, &gaussians) == L4GS_STATUS_OK && gaussians);
    CHECK(l4gs_gaussians_counts(gaussians, &counts) == L4GS_STATUS_OK);
    CHECK(counts.sh_coefficients == (counts.sh_degree + 1) * (counts.sh_degree + 1));
    L4gsInriaArrays a = inria_arrays(counts.gaussians, counts.sh_coefficients - 1);
    CHECK(l4gs_gaussians_copy_inria(gaussians, counts.gaussians, &a) == L4GS_STATUS_OK);
    l4gs_gaussians_close(gaussians);
    return checksum_of(a, counts.gaussians, counts.sh_coefficients - 1);
}

static void golden(const char *folder) {
    char path[1024], name[64];
    float time;
    unsigned expected;
    int compared = 0;
    snprintf(path, sizeof path, "%s/frames.txt", folder);
    FILE *list = fopen(path, "r");
    CHECK(list);
    while (fscanf(list, "%63s %f %x", name, &time, &expected) == 3) {
        L4gsScene *scene;
        snprintf(path, sizeof path, "%s/%s.l4gs", folder, name);
        CHECK(l4gs_open_file(path, NULL, &scene) == L4GS_STATUS_OK);
        CHECK(checksum_at(scene, time) == expected);
        l4gs_close(scene);
        compared++;
    }
    fclose(list);
    CHECK(compared == 35);
    printf("%d times of golden streams: the same bits\n", compared);
}

/* Opens a take of the conformance set. */
static L4gsTake *open_take(const char *folder, const char *name, uint32_t kept) {
    char path[1024];
    L4gsTake *take;
    snprintf(path, sizeof path, "%s/../conformance/streams/takes/%s.l4gs", folder, name);
    CHECK(l4gs_take_open_file(path, NULL, kept, &take) == L4GS_STATUS_OK && take);
    return take;
}

/* The times of the takes that the conformance set has checksums of. */
static void golden_takes(const char *folder) {
    char path[1024], line[256], name[64];
    L4gsTake *take = NULL;
    int compared = 0;
    snprintf(path, sizeof path, "%s/../conformance/manifest/accepted.txt", folder);
    FILE *list = fopen(path, "r");
    CHECK(list);
    while (fgets(line, sizeof line, list)) {
        double seconds;
        unsigned expected;
        if (!strncmp(line, "from ", 5)) {
            l4gs_take_close(take);
            /* One segment is kept, so that each must be decoded again. */
            take = sscanf(line, "from ../streams/takes/%63[a-z]", name) == 1 ? open_take(folder, name, 1) : NULL;
        } else if (take && sscanf(line, "%lf all %x", &seconds, &expected) == 2) {
            CHECK(checksum_of_take(take, seconds) == expected);
            compared++;
        }
    }
    l4gs_take_close(take);
    fclose(list);
    CHECK(compared == 15);
    printf("%d times of takes: the same bits\n", compared);
}

static void take_metadata(const char *folder) {
    L4gsTake *take = open_take(folder, "segments", 0);
    L4gsTakeInfo info;
    double begin, end;
    const char *key, *value;
    CHECK(l4gs_take_info(take, &info) == L4GS_STATUS_OK);
    CHECK(info.seconds == 1.5 && fabsf(info.fps - 29.97f) < 1e-4f && info.segments == 2 && info.gaussians == 60);
    CHECK(!strncmp(l4gs_take_name(take), "a take ", 7));
    CHECK(l4gs_take_segment(take, 0, &begin, &end) == L4GS_STATUS_OK && begin == 0 && end == 0.3);
    CHECK(l4gs_take_segment(take, 1, &begin, &end) == L4GS_STATUS_OK && begin == 0.5 && end == 0.97);
    CHECK(l4gs_take_segment(take, 2, &begin, &end) == L4GS_STATUS_ARGUMENT && strstr(l4gs_last_error(), "segment 2"));
    CHECK(info.extras > 0);
    for (uint32_t i = 0; i < info.extras; i++) {
        CHECK(l4gs_take_extra(take, i, &key, &value) == L4GS_STATUS_OK && strlen(key) > 0 && value);
    }
    l4gs_take_close(take);
    take = open_take(folder, "nothing", 0);
    L4gsGaussians *gaussians;
    L4gsCounts counts;
    CHECK(l4gs_take_prepare(take, 3) == L4GS_STATUS_OK);
    CHECK(l4gs_take_gaussians(take, 3, &gaussians) == L4GS_STATUS_OK);
    CHECK(l4gs_gaussians_counts(gaussians, &counts) == L4GS_STATUS_OK && counts.gaussians == 0);
    L4gsGsplatArrays none = {NULL, NULL, NULL, NULL, NULL};
    CHECK(l4gs_gaussians_copy_gsplat(gaussians, 0, &none) == L4GS_STATUS_OK);
    l4gs_gaussians_close(gaussians);
    l4gs_take_close(take);
}

static void take_picture(const char *folder) {
    L4gsTake *take = open_take(folder, "segments", 0);
    L4gsCamera camera = {40, 30, 40, 40, 20, 15, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 4}};
    enum { FLOATS = 3 * 40 * 30 };
    float *first = floats(FLOATS), *second = floats(FLOATS);
    CHECK(l4gs_take_prepare(take, 0.1) == L4GS_STATUS_OK);
    CHECK(l4gs_take_render(take, &camera, 0.1, NULL, first, FLOATS) == L4GS_STATUS_OK);
    CHECK(l4gs_take_render(take, &camera, 0.6, NULL, second, FLOATS) == L4GS_STATUS_OK);
    CHECK(memcmp(first, second, FLOATS * sizeof(float)));
    for (int i = 0; i < FLOATS; i++) {
        CHECK(isfinite(first[i]) && first[i] >= 0 && isfinite(second[i]) && second[i] >= 0);
    }
    CHECK(l4gs_take_render(take, &camera, NAN, NULL, first, FLOATS) == L4GS_STATUS_ARGUMENT);
    CHECK(l4gs_take_render(take, &camera, 0.1, NULL, first, FLOATS - 1) == L4GS_STATUS_ARGUMENT);
    free(first), free(second);
    l4gs_take_close(take);
}

/* A take of which a byte is wrong is refused where that byte is read, and shows the sound Gaussians elsewhere. */
static void take_damage(const char *folder) {
    char path[1024];
    size_t length;
    int refused = 0, shown = 0;
    L4gsTake *take = open_take(folder, "segments", 0);
    L4gsScene *scene;
    const double times[3] = {0.1, 0.6, 0.4};
    uint32_t sound[3];
    for (int i = 0; i < 3; i++) {
        sound[i] = checksum_of_take(take, times[i]);
    }
    l4gs_take_close(take);
    snprintf(path, sizeof path, "%s/../conformance/streams/takes/segments.l4gs", folder);
    unsigned char *bytes = read_file(path, &length);
    for (size_t at = 0; at < length; at += 7) {
        bytes[at] ^= 1u << at % 8;
        if (l4gs_take_open_bytes(bytes, length, NULL, 1, &take) == L4GS_STATUS_OK) {
            for (int i = 0; i < 3; i++) {
                if (l4gs_take_prepare(take, times[i]) == L4GS_STATUS_OK) {
                    CHECK(checksum_of_take(take, times[i]) == sound[i]);
                    shown++;
                } else {
                    CHECK(!strcmp(l4gs_last_error_kind(), "checksum") && strstr(l4gs_last_error(), "segment"));
                    refused++;
                }
            }
            l4gs_take_close(take);
        } else {
            CHECK(!take && strlen(l4gs_last_error()) > 0);
            refused++;
        }
        bytes[at] ^= 1u << at % 8;
        CHECK(l4gs_take_open_bytes(bytes, at, NULL, 1, &take) != L4GS_STATUS_OK && !take);
    }
    CHECK(refused > 0 && shown > 0);
    /* Each says what opens the other. */
    CHECK(l4gs_open_bytes(bytes, length, NULL, &scene) == L4GS_STATUS_NOT_L4GS && !strcmp(l4gs_last_error_kind(), "is-take"));
    free(bytes);
    snprintf(path, sizeof path, "%s/compact.l4gs", folder);
    CHECK(l4gs_take_open_file(path, NULL, 0, &take) == L4GS_STATUS_NOT_L4GS && !strcmp(l4gs_last_error_kind(), "not-take"));
}

static void metadata(const char *folder) {
    char path[1024];
    L4gsScene *scene;
    L4gsInfo info;
    snprintf(path, sizeof path, "%s/nodes.l4gs", folder);
    L4gsLimits large = l4gs_limits_large();
    CHECK(l4gs_open_file(path, &large, &scene) == L4GS_STATUS_OK);
    CHECK(l4gs_info(scene, &info) == L4GS_STATUS_OK);
    CHECK(info.gaussians > 0 && info.sh_degree <= 3 && info.sections >= 5);
    CHECK(l4gs_name(scene) && strlen(l4gs_version()) >= 5);
    uint64_t all = 0;
    for (uint32_t i = 0; i < info.sections; i++) {
        const char *name;
        uint64_t bytes;
        CHECK(l4gs_section(scene, i, &name, &bytes) == L4GS_STATUS_OK && strlen(name) > 0);
        all += bytes;
    }
    CHECK(all < info.bytes);
    for (uint32_t i = 0; i < info.extras; i++) {
        const char *key, *value;
        CHECK(l4gs_extra(scene, i, &key, &value) == L4GS_STATUS_OK && strlen(key) > 0 && value);
    }
    CHECK(l4gs_section(scene, info.sections, &(const char *){0}, &all) == L4GS_STATUS_ARGUMENT);
    l4gs_close(scene);
}

static void picture(const char *folder) {
    char path[1024];
    L4gsScene *scene;
    L4gsInfo info;
    snprintf(path, sizeof path, "%s/compact.l4gs", folder);
    CHECK(l4gs_open_file(path, NULL, &scene) == L4GS_STATUS_OK);
    CHECK(l4gs_info(scene, &info) == L4GS_STATUS_OK);
    L4gsCamera camera = {40, 30, 40, 40, 20, 15, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 4}};
    float *image = floats(3 * 40 * 30), green[3] = {0, 1, 0};
    CHECK(l4gs_render(scene, &camera, 0.5f, green, image, 3 * 40 * 30) == L4GS_STATUS_OK);
    double sum = 0;
    for (int i = 0; i < 3 * 40 * 30; i++) {
        CHECK(isfinite(image[i]) && image[i] >= 0);
        sum += image[i];
    }
    CHECK(sum > 0);
    /* Away from the scene there is only the background. */
    camera.translation[2] = -1000;
    CHECK(l4gs_render(scene, &camera, 0.5f, NULL, image, 3 * 40 * 30) == L4GS_STATUS_OK);
    CHECK(image[0] == info.background[0] && image[1] == info.background[1] && image[2] == info.background[2]);

    CHECK(l4gs_render(scene, &camera, 2.0f, NULL, image, 3 * 40 * 30) == L4GS_STATUS_ARGUMENT);
    CHECK(l4gs_render(scene, &camera, 0.5f, NULL, image, 3 * 40 * 30 - 1) == L4GS_STATUS_ARGUMENT);
    camera.fx = NAN;
    CHECK(l4gs_render(scene, &camera, 0.5f, NULL, image, 3 * 40 * 30) == L4GS_STATUS_ARGUMENT);
    CHECK(strstr(l4gs_last_error(), "camera"));
    free(image);
    l4gs_close(scene);
}

static void damage(const char *folder) {
    char path[1024];
    size_t length;
    L4gsScene *scene;
    snprintf(path, sizeof path, "%s/compact.l4gs", folder);
    unsigned char *bytes = read_file(path, &length);
    CHECK(l4gs_open_bytes(bytes, length, NULL, &scene) == L4GS_STATUS_OK);
    l4gs_close(scene);
    for (size_t i = 0; i < length; i += 7) {
        bytes[i] ^= 1u << i % 8;
        CHECK(l4gs_open_bytes(bytes, length, NULL, &scene) != L4GS_STATUS_OK && !scene);
        CHECK(strlen(l4gs_last_error()) > 0 && strlen(l4gs_last_error_kind()) > 0);
        bytes[i] ^= 1u << i % 8;
        CHECK(l4gs_open_bytes(bytes, i, NULL, &scene) != L4GS_STATUS_OK && !scene);
    }
    bytes[0] = 'P';
    CHECK(l4gs_open_bytes(bytes, length, NULL, &scene) == L4GS_STATUS_NOT_L4GS);
    CHECK(!strcmp(l4gs_last_error_kind(), "not-l4gs"));
    CHECK(l4gs_open_file("/no/such/file.l4gs", NULL, &scene) == L4GS_STATUS_FILE && !scene);
    CHECK(l4gs_open_bytes(NULL, 0, NULL, &scene) == L4GS_STATUS_ARGUMENT);
    CHECK(l4gs_open_file(NULL, NULL, NULL) == L4GS_STATUS_ARGUMENT);
    l4gs_close(NULL);
    free(bytes);
}

int main(int count, char **arguments) {
    CHECK(count == 2);
    golden(arguments[1]);
    metadata(arguments[1]);
    picture(arguments[1]);
    damage(arguments[1]);
    golden_takes(arguments[1]);
    take_metadata(arguments[1]);
    take_picture(arguments[1]);
    take_damage(arguments[1]);
    printf("light4gs %s through C: ok\n", l4gs_version());
    return 0;
}
