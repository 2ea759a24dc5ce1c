/* Small FMUs that test an importer, of FMI 2.0 and 3.0 for model exchange, written from the
 * standard.
 *
 * One library has all models; the token chooses among them. Each checks every call against the
 * rules of the standard and counts what breaks them in the variable `violations`. In FMI 3.0 the
 * states are one array. With PROBE_LOUD in the environment each violation is printed. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED, INITIALIZATION, EVENT, CONTINUOUS, TERMINATED };
/* Value references. */
enum { X = 0, P = 10, COUNT = 20, VIOLATIONS = 30, Q = 31, U = 40, D = 41, Z = 50, DER = 100 };

typedef struct {
    bool again, end, nominals, values;
} Info;

typedef struct Model Model;
typedef struct {
    const Model* model;
    int mode, violations;
    bool again; /* the event iteration is not over */
    double t, t_event, t_completed, t_before_completed, next;
    double x[2], p[3], u, d;
    int q, updates, counts[8];
} M;

struct Model {
    const char* name;
    size_t nx, nz;
    void (*start)(M*);
    int (*flow)(const M*, double* dxdt);
    void (*indicators)(const M*, double* z);
    void (*update)(M*, Info*);
};

static int bad(M* m, int line)
{
    ++m->violations;
    if (getenv("PROBE_LOUD"))
        fprintf(stderr, "%s: violation at line %d, t = %.17g\n", m->model->name, line, m->t);
    return 0;
}
#define BAD(m) bad(m, __LINE__)

/* ---- models: start, flow, indicators, one round of event iteration ---- */

static void start_drop(M* m)
{
    m->x[0] = 1, m->p[0] = 9.81, m->p[1] = 0.7;
}
static int flow_fall(const M* m, double* d)
{
    return d[0] = m->x[1], d[1] = m->q ? 0 : -m->p[0], OK;
}
static void z_height(const M* m, double* z)
{
    z[0] = m->x[0];
}
static bool bounce(M* m, Info* info)
{
    if (!(m->x[0] <= 0 && m->x[1] < 0)) return ++m->counts[1], false; /* called for nothing */
    m->x[0] = 0x1p-1022, m->x[1] *= -m->p[1], info->values = true, ++m->counts[0];
    return true;
}
/* A ball that resets only where it is really below its floor, and stops below 0.1 m/s. */
static void update_ball(M* m, Info* info)
{
    if (bounce(m, info) && m->x[1] < 0.1) m->x[1] = 0, m->q = 1;
}
/* A ball that never stops. */
static void update_zeno(M* m, Info* info)
{
    bounce(m, info);
}

/* A ball whose indicator is the sign of a relation with a hysteresis of 1e-10. */
static bool relation(const M* m)
{
    return m->q ? m->x[0] <= 1e-10 : m->x[0] <= -1e-10;
}
static int flow_relation(const M* m, double* d)
{
    return d[0] = m->x[1], d[1] = -m->p[0], OK;
}
static void z_relation(const M* m, double* z)
{
    z[0] = relation(m) ? 1 : -1;
}
static void update_relation(M* m, Info* info)
{
    const bool r = relation(m);
    if (r && !m->q)
        m->x[1] *= -m->p[1], info->values = true, ++m->counts[0];
    else
        ++m->counts[1];
    m->q = r;
}

/* A thermostat with two indicators of +1 and -1; no state changes at its events. */
static void start_room(M* m)
{
    m->x[0] = 19, m->q = 1;
}
static int flow_room(const M* m, double* d)
{
    return d[0] = (m->q ? 30 : 15) - m->x[0], OK;
}
static void z_relay(const M* m, double* z)
{
    z[0] = m->x[0] > 22 ? 1 : -1, z[1] = m->x[0] < 18 ? 1 : -1;
}
static void update_relay(M* m, Info* info)
{
    (void)info;
    if (m->q && m->x[0] > 22)
        m->q = 0, ++m->counts[0];
    else if (!m->q && m->x[0] < 18)
        m->q = 1, ++m->counts[0];
    else
        ++m->counts[1];
}
/* The same with one indicator, whose sign is restored at each event. */
static void z_restored(const M* m, double* z)
{
    z[0] = m->q ? 22 - m->x[0] : m->x[0] - 18;
}
static void update_restored(M* m, Info* info)
{
    (void)info;
    if (m->q && m->x[0] >= 22)
        m->q = 0, ++m->counts[0];
    else if (!m->q && m->x[0] <= 18)
        m->q = 1, ++m->counts[0];
    else
        ++m->counts[1];
}

/* A state event at every half schedules a time event 0.1 s later; another one, at 2.55, cancels it.
 */
static int flow_timer(const M* m, double* d)
{
    return d[0] = 1, d[1] = m->q, OK;
}
static void z_timer(const M* m, double* z)
{
    z[0] = fmod(m->x[0], 1) - 0.5, z[1] = m->x[0] - 2.55;
}
static void update_timer(M* m, Info* info)
{
    (void)info;
    if (m->t >= m->next)
        m->next = INFINITY, ++m->q, ++m->counts[2];
    else if (m->x[0] > 2.55 && !m->counts[3])
        m->next = INFINITY, ++m->counts[3];
    else if (fmod(m->x[0], 1) - 0.5 > 0 && m->updates == 0)
        m->next = m->t + 0.1, ++m->counts[0];
    else
        ++m->counts[1];
}

/* An event of five rounds, in the last of which another indicator changes its side. */
static int flow_cascade(const M* m, double* d)
{
    return d[0] = 1 + m->q, OK;
}
static void z_cascade(const M* m, double* z)
{
    z[0] = m->x[0] - 1, z[1] = 4.5 - m->q;
}
static void update_cascade(M* m, Info* info)
{
    if (m->x[0] >= 1 && m->q < 5)
        ++m->q, ++m->counts[0], info->again = m->q < 5;
    else
        ++m->counts[1];
}

/* A pendulum in a chart whose origin q [rad] follows it: a completed step asks for event mode. */
static void start_chart(M* m)
{
    m->x[0] = 1;
}
static int flow_chart(const M* m, double* d)
{
    return d[0] = m->x[1], d[1] = -sin(m->x[0] + m->q), OK;
}
static void update_chart(M* m, Info* info)
{
    const int by = m->x[0] > 0 ? 1 : -1;
    if (fabs(m->x[0]) > 0.5)
        m->q += by, m->x[0] -= by, info->values = true, ++m->counts[0];
    else
        ++m->counts[1];
}

/* An indicator that is zero at the start and then positive: <= 0 to > 0 is an event. */
static int flow_one(const M* m, double* d)
{
    return (void)m, d[0] = 1, OK;
}
static void z_x(const M* m, double* z)
{
    z[0] = m->x[0];
}
static void update_count(M* m, Info* info)
{
    (void)info, ++m->counts[0];
}

/* x' = -sqrt(x), which ends at x = 0; an event at 0.01. */
static void start_one(M* m)
{
    m->x[0] = 1;
}
static int flow_root(const M* m, double* d)
{
    return m->x[0] < 0 ? DISCARD : (d[0] = -sqrt(m->x[0]), OK);
}
static void z_root(const M* m, double* z)
{
    z[0] = m->x[0] - 0.01;
}

/* x' = -p0 (x - cos t). */
static void start_stiff(M* m)
{
    m->p[0] = 1e6;
}
static int flow_stiff(const M* m, double* d)
{
    return d[0] = -m->p[0] * (m->x[0] - cos(m->t)), OK;
}

/* Two falling points; the impact of one throws the other across its indicator. */
static void start_two(M* m)
{
    m->x[0] = 1, m->x[1] = 2;
}
static int flow_two(const M* m, double* d)
{
    return (void)m, d[0] = d[1] = -1, OK;
}
static void z_two(const M* m, double* z)
{
    z[0] = m->x[0], z[1] = m->x[1];
}
static void update_two(M* m, Info* info)
{
    if (m->x[0] <= 0)
        m->x[0] = 1, m->x[1] = -0.5, info->values = true, ++m->counts[0];
    else if (m->x[1] <= 0)
        m->x[1] = 2, info->values = true, ++m->counts[2];
    else
        ++m->counts[1];
}

/* x' = -sign(x), with a frozen relation. */
static void start_slide(M* m)
{
    m->x[0] = 1, m->q = 1;
}
static int flow_slide(const M* m, double* d)
{
    return d[0] = m->q ? -1 : 1, OK;
}
static void update_slide(M* m, Info* info)
{
    (void)info, m->q = m->x[0] > 0, ++m->counts[0];
}

/* x1' = u, x2' = d: a continuous and a discrete input. Each event mode counts. */
static int flow_inputs(const M* m, double* d)
{
    return d[0] = m->u, d[1] = m->d, OK;
}

/* No states; a time event at every second; output q. */
static void start_clock(M* m)
{
    m->next = 1;
}
static int flow_none(const M* m, double* d)
{
    return (void)m, (void)d, OK;
}
static void update_clock(M* m, Info* info)
{
    (void)info;
    if (m->t >= m->next) ++m->q, m->next += 1;
}

/* A decay whose event fails: p0 = 3 an error, 4 a fatal one; 1: endless rounds; 2: terminates; 5:
 * NaN. */
static void start_faulty(M* m)
{
    m->x[0] = 1, m->p[0] = 3;
}
static int flow_decay(const M* m, double* d)
{
    return d[0] = m->q ? NAN : -m->x[0], OK;
}
static void z_half(const M* m, double* z)
{
    z[0] = m->x[0] - 0.5;
}
static void update_faulty(M* m, Info* info)
{
    if (m->x[0] > 0.5) return;
    info->again = m->p[0] == 1, info->end = m->p[0] == 2, m->q = m->p[0] == 5;
}

/* Its nominal values change at an event, from 0 to 1e-3. */
static void update_nominals(M* m, Info* info)
{
    m->q = m->x[0] <= 0.5, info->nominals = true, ++m->counts[0];
}
static int flow_nominals(const M* m, double* d)
{
    return d[0] = -m->x[0], OK;
}

/* Robertson's reactions, two of three; its directional derivatives forget the third. */
static int flow_reactions(const M* m, double* d)
{
    const double y3 = 1 - m->x[0] - m->x[1];
    d[0] = -0.04 * m->x[0] + 1e4 * m->x[1] * y3;
    return d[1] = -d[0] - 3e7 * m->x[1] * m->x[1], OK;
}

/* A clock that prints at its first event and ends the process at its second. */
static int flow_clock(const M* m, double* d)
{
    return (void)m, d[0] = 1, OK;
}
static void z_clock(const M* m, double* z)
{
    z[0] = m->x[0] - 1 - m->q;
}
static void update_killer(M* m, Info* info)
{
    (void)info;
    if (m->x[0] < 1) return;
    if (m->q == 0) printf("a library that prints\n");
    if (m->q == 1 && m->p[0] == 0) abort();
    if (m->q == 1 && m->p[0] == 1) exit(3);
    ++m->q;
}

/* Its rate and its indicator depend on how often they were asked for. */
static int flow_forgetful(const M* m, double* d)
{
    return d[0] = 1 + ((M*)m)->counts[7]++ * 1e-9, OK;
}
static void z_forgetful(const M* m, double* z)
{
    z[0] = m->x[0] - 2 + m->counts[7] * 1e-9;
}

static const Model models[] = {
    {"Ball", 2, 1, start_drop, flow_fall, z_height, update_ball},
    {"Zeno", 2, 1, start_drop, flow_fall, z_height, update_zeno},
    {"Relation", 2, 1, start_drop, flow_relation, z_relation, update_relation},
    {"Relay", 1, 2, start_room, flow_room, z_relay, update_relay},
    {"Restored", 1, 1, start_room, flow_room, z_restored, update_restored},
    {"Timer", 2, 2, NULL, flow_timer, z_timer, update_timer},
    {"Cascade", 1, 2, NULL, flow_cascade, z_cascade, update_cascade},
    {"StepEvent", 2, 0, start_chart, flow_chart, NULL, update_chart},
    {"Zero", 1, 1, NULL, flow_one, z_x, update_count},
    {"Discard", 1, 1, start_one, flow_root, z_root, update_count},
    {"Stiff", 1, 0, start_stiff, flow_stiff, NULL, update_count},
    {"Two", 2, 2, start_two, flow_two, z_two, update_two},
    {"Slide", 1, 1, start_slide, flow_slide, z_x, update_slide},
    {"Inputs", 2, 0, NULL, flow_inputs, NULL, update_count},
    {"Clock", 0, 0, start_clock, flow_none, NULL, update_clock},
    {"Faulty", 1, 1, start_faulty, flow_decay, z_half, update_faulty},
    {"Killer", 1, 1, NULL, flow_clock, z_clock, update_killer},
    {"Forgetful", 1, 1, NULL, flow_forgetful, z_forgetful, update_count},
    {"Nominals", 1, 1, start_one, flow_nominals, z_half, update_nominals},
    {"Reactions", 2, 0, start_one, flow_reactions, NULL, update_count},
};

static bool is(const M* m, const char* name)
{
    return strcmp(m->model->name, name) == 0;
}

/* ---- what both versions do ---- */

static M* instantiate(const char* token)
{
    for (size_t i = 0; token && i < sizeof models / sizeof *models; ++i) {
        if (strcmp(token, models[i].name) != 0) continue;
        M* m = calloc(1, sizeof *m);
        if (!m) return NULL;
        m->model = &models[i], m->next = INFINITY;
        if (m->model->start) m->model->start(m);
        return m;
    }
    return NULL;
}
static int enter_initialization(M* m, double t)
{
    if (m->mode != INSTANTIATED) BAD(m);
    m->mode = INITIALIZATION, m->t = m->t_event = m->t_completed = m->t_before_completed = t;
    return OK;
}
static int exit_initialization(M* m)
{
    return m->mode == INITIALIZATION ? 0 : BAD(m), m->mode = EVENT, m->again = true, OK;
}
static int enter_event(M* m)
{
    if (m->mode != CONTINUOUS) BAD(m);
    m->mode = EVENT, m->t_event = m->t, m->updates = 0, m->again = true;
    return OK;
}
static int enter_continuous(M* m)
{
    return m->mode == EVENT && !m->again ? 0 : BAD(m), m->mode = CONTINUOUS, OK;
}
static int update(M* m, Info* info)
{
    if (m->mode != EVENT) BAD(m);
    memset(info, 0, sizeof *info);
    m->model->update(m, info);
    ++m->updates, m->again = info->again;
    return is(m, "Faulty") && m->x[0] <= 0.5 && (m->p[0] == 3 || m->p[0] == 4) ? (int)m->p[0] : OK;
}
static int completed(M* m, bool* enter, bool* end)
{
    if (m->mode != CONTINUOUS || m->t < m->t_completed) BAD(m);
    m->t_before_completed = m->t_completed, m->t_completed = m->t;
    *enter = is(m, "StepEvent") && fabs(m->x[0]) > 0.75, *end = false;
    return OK;
}
static int set_time(M* m, double t)
{
    if (m->mode != CONTINUOUS) BAD(m);
    if (t < m->t_event || t < m->t_before_completed) BAD(m);
    if (t > m->next) BAD(m); /* the time event was passed over */
    m->t = t;
    return OK;
}
static int set_states(M* m, const double* x, size_t n)
{
    if (m->mode != CONTINUOUS || n != m->model->nx) BAD(m);
    memcpy(m->x, x, n * sizeof *x);
    return OK;
}
static int get_states(M* m, double* x, size_t n)
{
    if (m->mode < EVENT || n != m->model->nx) BAD(m);
    memcpy(x, m->x, n * sizeof *x);
    return OK;
}
static int get_nominals(M* m, double* x, size_t n)
{
    if (m->mode < EVENT || n != m->model->nx) BAD(m);
    for (size_t i = 0; i < n; ++i)
        x[i] = is(m, "Nominals") ? (m->q ? 1e-3 : 0) : is(m, "Reactions") && i == 1 ? 1e-4 : 1;
    return OK;
}
static int derivatives(M* m, double* d, size_t n)
{
    if (m->mode < EVENT || n != m->model->nx) BAD(m);
    return m->model->flow(m, d);
}
static int indicators(M* m, double* z, size_t n)
{
    if (m->mode < INITIALIZATION || n != m->model->nz) BAD(m);
    if (m->model->indicators) m->model->indicators(m, z);
    return OK;
}
static int directional(M* m, size_t n, unsigned known, const double* seed, double* column)
{
    if (m->mode < INITIALIZATION || n != m->model->nx) BAD(m);
    if (is(m, "Stiff")) return column[0] = -m->p[0] * seed[0], OK;
    if (!is(m, "Reactions")) return ERROR;
    const double y3 = 1 - m->x[0] - m->x[1];
    const double a = known == 0 ? -0.04 : 1e4 * y3;
    const double b = known == 0 ? 0.04 : -1e4 * y3 - 6e7 * m->x[1];
    return column[0] = a, column[1] = b, OK;
}
static int terminate(M* m)
{
    return m->mode < EVENT ? BAD(m) : 0, m->mode = TERMINATED, OK;
}

static double* writable(M* m, unsigned r)
{
    const bool before = m->mode <= INITIALIZATION;
    if (r < 2) return before ? &m->x[r] : NULL;
    if (r >= P && r < P + 3) return before || m->mode == EVENT ? &m->p[r - P] : NULL;
    if (r == U) return m->mode == TERMINATED ? NULL : &m->u;
    if (r == D) return m->mode == CONTINUOUS || m->mode == TERMINATED ? NULL : &m->d;
    return NULL;
}
static int set(M* m, unsigned r, double value)
{
    double* const place = writable(m, r);
    if (!place) return BAD(m), ERROR;
    *place = value;
    return OK;
}
static int get(M* m, unsigned r, double* value)
{
    double d[2] = {0, 0}, z[2] = {0, 0};
    if (r < 2)
        *value = m->x[r];
    else if (r >= P && r < P + 3)
        *value = m->p[r - P];
    else if (r >= COUNT && r < COUNT + 8)
        *value = m->counts[r - COUNT];
    else if (r == VIOLATIONS)
        *value = m->violations;
    else if (r == Q)
        *value = m->q;
    else if (r == U)
        *value = m->u;
    else if (r == D)
        *value = m->d;
    else if (r >= Z && r < Z + 2)
        indicators(m, z, m->model->nz), *value = z[r - Z];
    else if (r >= DER && r < DER + 2)
        m->model->flow(m, d), *value = d[r - DER];
    else
        return ERROR;
    return OK;
}

/* ---- FMI 2.0 ---- */

typedef struct {
    int again, end, nominals, values, defined;
    double next;
} Info2;

EXPORT const char* fmi2GetTypesPlatform(void)
{
    return "default";
}
EXPORT const char* fmi2GetVersion(void)
{
    return "2.0";
}
EXPORT void* fmi2Instantiate(const char* name, int type, const char* guid, const char* where,
                             const void* f, int visible, int log)
{
    (void)name, (void)where, (void)f, (void)visible, (void)log;
    return type == 0 ? instantiate(guid) : NULL;
}
EXPORT void fmi2FreeInstance(M* m)
{
    free(m);
}
EXPORT int fmi2SetupExperiment(M* m, int td, double tol, double t, int sd, double stop)
{
    (void)td, (void)tol, (void)sd, (void)stop;
    m->t = t;
    return OK;
}
EXPORT int fmi2EnterInitializationMode(M* m)
{
    return enter_initialization(m, m->t);
}
EXPORT int fmi2ExitInitializationMode(M* m)
{
    return exit_initialization(m);
}
EXPORT int fmi2EnterEventMode(M* m)
{
    return enter_event(m);
}
EXPORT int fmi2NewDiscreteStates(M* m, Info2* out)
{
    Info info;
    const int status = update(m, &info);
    *out = (Info2){info.again, info.end, info.nominals, info.values, isfinite(m->next), m->next};
    if (status == FATAL) free(m); /* nothing may be called after this, FreeInstance neither */
    return status;
}
EXPORT int fmi2EnterContinuousTimeMode(M* m)
{
    return enter_continuous(m);
}
EXPORT int fmi2CompletedIntegratorStep(M* m, int no, int* enter, int* end)
{
    bool e, t;
    (void)no;
    completed(m, &e, &t);
    *enter = e, *end = t;
    return OK;
}
EXPORT int fmi2SetTime(M* m, double t)
{
    return set_time(m, t);
}
EXPORT int fmi2SetContinuousStates(M* m, const double* x, size_t n)
{
    return set_states(m, x, n);
}
EXPORT int fmi2GetContinuousStates(M* m, double* x, size_t n)
{
    return get_states(m, x, n);
}
EXPORT int fmi2GetNominalsOfContinuousStates(M* m, double* x, size_t n)
{
    return get_nominals(m, x, n);
}
EXPORT int fmi2GetDerivatives(M* m, double* d, size_t n)
{
    return derivatives(m, d, n);
}
EXPORT int fmi2GetEventIndicators(M* m, double* z, size_t n)
{
    return indicators(m, z, n);
}
EXPORT int fmi2Terminate(M* m)
{
    return terminate(m);
}
EXPORT int fmi2GetReal(M* m, const unsigned* r, size_t n, double* v)
{
    int status = OK;
    for (size_t i = 0; i < n && status == OK; ++i) status = get(m, r[i], &v[i]);
    return status;
}
EXPORT int fmi2SetReal(M* m, const unsigned* r, size_t n, const double* v)
{
    int status = OK;
    for (size_t i = 0; i < n && status == OK; ++i) status = set(m, r[i], v[i]);
    return status;
}
EXPORT int fmi2GetInteger(M* m, const unsigned* r, size_t n, int* v)
{
    int status = OK;
    for (size_t i = 0; i < n && status == OK; ++i) {
        double value = 0;
        status = get(m, r[i], &value);
        v[i] = (int)value;
    }
    return status;
}
EXPORT int fmi2GetDirectionalDerivative(M* m, const unsigned* u, size_t nu, const unsigned* k,
                                        size_t nk, const double* dk, double* du)
{
    (void)u;
    return nk == 1 ? directional(m, nu, k[0], dk, du) : ERROR;
}
#define NOT(name)         \
    EXPORT int name(void) \
    {                     \
        return ERROR;     \
    }
NOT(fmi2GetBoolean);
NOT(fmi2SetInteger);
NOT(fmi2SetBoolean);

/* ---- FMI 3.0: the state is one array ---- */

EXPORT const char* fmi3GetVersion(void)
{
    return "3.0";
}
EXPORT void* fmi3InstantiateModelExchange(const char* name, const char* token, const char* where,
                                          bool visible, bool log, void* environment, void* logger)
{
    (void)name, (void)where, (void)visible, (void)log, (void)environment, (void)logger;
    return instantiate(token);
}
EXPORT void fmi3FreeInstance(M* m)
{
    free(m);
}
EXPORT int fmi3EnterInitializationMode(M* m, bool td, double tol, double t, bool sd, double stop)
{
    (void)td, (void)tol, (void)sd, (void)stop;
    return enter_initialization(m, t);
}
EXPORT int fmi3ExitInitializationMode(M* m)
{
    return exit_initialization(m);
}
EXPORT int fmi3EnterEventMode(M* m)
{
    return enter_event(m);
}
EXPORT int fmi3UpdateDiscreteStates(M* m, bool* again, bool* end, bool* nominals, bool* values,
                                    bool* defined, double* next)
{
    Info info;
    const int status = update(m, &info);
    *again = info.again, *end = info.end, *nominals = info.nominals, *values = info.values;
    *defined = isfinite(m->next), *next = m->next;
    if (status == FATAL) free(m);
    return status;
}
EXPORT int fmi3EnterContinuousTimeMode(M* m)
{
    return enter_continuous(m);
}
EXPORT int fmi3CompletedIntegratorStep(M* m, bool no, bool* enter, bool* end)
{
    return (void)no, completed(m, enter, end);
}
EXPORT int fmi3SetTime(M* m, double t)
{
    return set_time(m, t);
}
EXPORT int fmi3SetContinuousStates(M* m, const double* x, size_t n)
{
    return set_states(m, x, n);
}
EXPORT int fmi3GetContinuousStates(M* m, double* x, size_t n)
{
    return get_states(m, x, n);
}
EXPORT int fmi3GetNominalsOfContinuousStates(M* m, double* x, size_t n)
{
    return get_nominals(m, x, n);
}
EXPORT int fmi3GetContinuousStateDerivatives(M* m, double* d, size_t n)
{
    return derivatives(m, d, n);
}
EXPORT int fmi3GetEventIndicators(M* m, double* z, size_t n)
{
    return indicators(m, z, n);
}
EXPORT int fmi3Terminate(M* m)
{
    return terminate(m);
}
EXPORT int fmi3GetNumberOfContinuousStates(M* m, size_t* n)
{
    return *n = m->model->nx, OK;
}
EXPORT int fmi3GetNumberOfEventIndicators(M* m, size_t* n)
{
    return *n = m->model->nz, OK;
}
static size_t size_of(const M* m, unsigned r)
{
    return r == X || r == DER ? m->model->nx : 1;
}
EXPORT int fmi3GetFloat64(M* m, const uint32_t* r, size_t n, double* v, size_t nv)
{
    size_t at = 0;
    for (size_t i = 0; i < n; ++i) {
        for (size_t k = 0; k < size_of(m, r[i]); ++k) {
            if (at == nv || get(m, r[i] + (unsigned)k, &v[at++]) != OK) return ERROR;
        }
    }
    return at == nv ? OK : ERROR;
}
EXPORT int fmi3SetFloat64(M* m, const uint32_t* r, size_t n, const double* v, size_t nv)
{
    size_t at = 0;
    for (size_t i = 0; i < n; ++i) {
        for (size_t k = 0; k < size_of(m, r[i]); ++k) {
            if (at == nv || set(m, r[i] + (unsigned)k, v[at++]) != OK) return ERROR;
        }
    }
    return at == nv ? OK : ERROR;
}
EXPORT int fmi3GetInt32(M* m, const uint32_t* r, size_t n, int32_t* v, size_t nv)
{
    (void)nv;
    return fmi2GetInteger(m, r, n, v);
}
EXPORT int fmi3GetDirectionalDerivative(M* m, const uint32_t* u, size_t nu, const uint32_t* k,
                                        size_t nk, const double* seed, size_t nseed, double* column,
                                        size_t ncolumn)
{
    (void)u;
    if (nu != 1 || nk != 1 || k[0] != X || nseed != m->model->nx || ncolumn != nseed)
        return BAD(m), ERROR;
    return directional(m, ncolumn, nseed > 1 && seed[1] != 0, seed, column);
}
NOT(fmi3GetFloat32);
NOT(fmi3SetFloat32);
NOT(fmi3GetInt8);
NOT(fmi3SetInt8);
NOT(fmi3GetUInt8);
NOT(fmi3SetUInt8);
NOT(fmi3GetInt16);
NOT(fmi3SetInt16);
NOT(fmi3GetUInt16);
NOT(fmi3SetUInt16);
NOT(fmi3SetInt32);
NOT(fmi3GetUInt32);
NOT(fmi3SetUInt32);
NOT(fmi3GetInt64);
NOT(fmi3SetInt64);
NOT(fmi3GetUInt64);
NOT(fmi3SetUInt64);
NOT(fmi3GetBoolean);
NOT(fmi3SetBoolean);
