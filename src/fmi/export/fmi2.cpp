// The functions of FMI 2.0, by the names and signatures of the standard, for one exported model.
#include "fmi/export/instance.hpp"

using namespace ricochet::fmi;
using namespace ricochet::fmi::detail;
using Exporting = ricochet::fmi::detail::Instance;

RICOCHET_FMI_EXPORT const char* fmi2GetTypesPlatform()
{
    return "default";
}
RICOCHET_FMI_EXPORT const char* fmi2GetVersion()
{
    return "2.0";
}
RICOCHET_FMI_EXPORT int fmi2SetDebugLogging(void*, int, std::size_t, const char* const*)
{
    return status_ok;
}
RICOCHET_FMI_EXPORT void* fmi2Instantiate(const char* name, int type, const char* guid,
                                          const char* resources, const Callbacks2* callbacks, int,
                                          int)
{
    void* const environment = callbacks != nullptr ? callbacks->environment : nullptr;
    const Exporting::Log2 log = callbacks != nullptr ? callbacks->logger : nullptr;
    return make_instance(2, type == 0, false, name, guid, resources, environment, log, nullptr);
}
RICOCHET_FMI_EXPORT void fmi2FreeInstance(void* c)
{
    delete static_cast<Exporting*>(c);
}
RICOCHET_FMI_EXPORT int fmi2SetupExperiment(void* c, int, double, double start, int, double)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::instantiated}, "fmi2SetupExperiment", [&] { i.model->t = start; });
}
RICOCHET_FMI_EXPORT int fmi2EnterInitializationMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::instantiated}, "fmi2EnterInitializationMode",
                     [&] { i.stage = Stage::initialization; });
}
RICOCHET_FMI_EXPORT int fmi2ExitInitializationMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::initialization}, "fmi2ExitInitializationMode", [&] { i.start(); });
}
RICOCHET_FMI_EXPORT int fmi2Terminate(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.stage = Stage::terminated; });
}
RICOCHET_FMI_EXPORT int fmi2Reset(void* c)
{
    return reset_instance(c);
}

// --- values ---

RICOCHET_FMI_EXPORT int fmi2GetReal(void* c, const Reference* r, std::size_t n, double* v)
{
    return get_values(c, r, n, v);
}
RICOCHET_FMI_EXPORT int fmi2SetReal(void* c, const Reference* r, std::size_t n, const double* v)
{
    return set_values(c, r, n, v);
}
RICOCHET_FMI_EXPORT int fmi2GetInteger(void* c, const Reference* r, std::size_t n, int* v)
{
    return get_whole(c, r, n, v);
}

namespace {

int none(void* c, std::size_t n, const char* type)
{
    return n == 0 ? static_cast<int>(status_ok)
                  : instance_of(c).fail(std::string("there are no variables of type ") + type);
}

}  // namespace

RICOCHET_FMI_EXPORT int fmi2SetInteger(void* c, const Reference*, std::size_t n, const int*)
{
    return none(c, n, "Integer that can be set");
}
RICOCHET_FMI_EXPORT int fmi2GetBoolean(void* c, const Reference*, std::size_t n, int*)
{
    return none(c, n, "Boolean");
}
RICOCHET_FMI_EXPORT int fmi2SetBoolean(void* c, const Reference*, std::size_t n, const int*)
{
    return none(c, n, "Boolean");
}
RICOCHET_FMI_EXPORT int fmi2GetString(void* c, const Reference*, std::size_t n, const char**)
{
    return none(c, n, "String");
}
RICOCHET_FMI_EXPORT int fmi2SetString(void* c, const Reference*, std::size_t n, const char* const*)
{
    return none(c, n, "String");
}

// --- states ---

RICOCHET_FMI_EXPORT int fmi2GetFMUstate(void* c, void** state)
{
    return save_state(c, state);
}
RICOCHET_FMI_EXPORT int fmi2SetFMUstate(void* c, void* state)
{
    return restore_state(c, state);
}
RICOCHET_FMI_EXPORT int fmi2FreeFMUstate(void*, void** state)
{
    return free_state(state);
}
RICOCHET_FMI_EXPORT int fmi2SerializedFMUstateSize(void* c, void* state, std::size_t* size)
{
    return state_size(c, state, size);
}
RICOCHET_FMI_EXPORT int fmi2SerializeFMUstate(void* c, void* state, char* bytes, std::size_t size)
{
    return write_state(c, state, bytes, size);
}
RICOCHET_FMI_EXPORT int fmi2DeSerializeFMUstate(void* c, const char* bytes, std::size_t size,
                                                void** state)
{
    return read_state(c, bytes, size, state);
}

// --- model exchange ---

RICOCHET_FMI_EXPORT int fmi2EnterEventMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::continuous, Stage::event}, "fmi2EnterEventMode",
                     [&] { i.stage = Stage::event; });
}
RICOCHET_FMI_EXPORT int fmi2NewDiscreteStates(void* c, EventInfo2* info)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::event}, "fmi2NewDiscreteStates", [&] {
        const ModelUpdate update = i.model->update();
        *info = {.new_discrete_states_needed = update.again,
                 .terminate = 0,
                 .nominals_changed = 0,
                 .values_changed = update.states_changed,
                 .next_time_defined = update.next_time < std::numeric_limits<double>::max(),
                 .next_time = update.next_time};
    });
}
RICOCHET_FMI_EXPORT int fmi2EnterContinuousTimeMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::event}, "fmi2EnterContinuousTimeMode",
                     [&] { i.stage = Stage::continuous; });
}
RICOCHET_FMI_EXPORT int fmi2CompletedIntegratorStep(void* c, int, int* event, int* end)
{
    *event = *end = 0;
    return instance_of(c).attempt({Stage::continuous}, "fmi2CompletedIntegratorStep", [] {});
}
RICOCHET_FMI_EXPORT int fmi2SetTime(void* c, double t)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.model->t = t; });
}
RICOCHET_FMI_EXPORT int fmi2SetContinuousStates(void* c, const double* x, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::continuous}, "fmi2SetContinuousStates", [&] { i.take_states(x, n); });
}
RICOCHET_FMI_EXPORT int fmi2GetContinuousStates(void* c, double* x, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.give_states(x, n); });
}
RICOCHET_FMI_EXPORT int fmi2GetNominalsOfContinuousStates(void*, double* x, std::size_t n)
{
    return unit_nominals(x, n);
}
RICOCHET_FMI_EXPORT int fmi2GetDerivatives(void* c, double* d, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.model->rates({d, n}); });
}
RICOCHET_FMI_EXPORT int fmi2GetEventIndicators(void* c, double* z, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.model->indicators({z, n}); });
}
RICOCHET_FMI_EXPORT int fmi2GetDirectionalDerivative(void* c, const Reference*, std::size_t,
                                                     const Reference*, std::size_t, const double*,
                                                     double*)
{
    return instance_of(c).fail("directional derivatives are not offered");
}

// --- co-simulation ---

RICOCHET_FMI_EXPORT int fmi2DoStep(void* c, double t, double h, int)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::step}, "fmi2DoStep", [&] { i.step(t, h, false); });
}
RICOCHET_FMI_EXPORT int fmi2SetRealInputDerivatives(void* c, const Reference*, std::size_t n,
                                                    const int*, const double*)
{
    return none(c, n, "input with derivatives");
}
RICOCHET_FMI_EXPORT int fmi2GetRealOutputDerivatives(void* c, const Reference*, std::size_t n,
                                                     const int*, double*)
{
    return none(c, n, "output with derivatives");
}
RICOCHET_FMI_EXPORT int fmi2CancelStep(void* c)
{
    return instance_of(c).fail("steps are not asynchronous");
}
RICOCHET_FMI_EXPORT int fmi2GetStatus(void*, int, int*)
{
    return status_discard;
}
RICOCHET_FMI_EXPORT int fmi2GetRealStatus(void* c, int kind, double* value)
{
    constexpr int last_successful_time = 2;
    if (kind != last_successful_time) return status_discard;
    *value = instance_of(c).last_time;
    return status_ok;
}
RICOCHET_FMI_EXPORT int fmi2GetIntegerStatus(void*, int, int*)
{
    return status_discard;
}
RICOCHET_FMI_EXPORT int fmi2GetBooleanStatus(void*, int kind, int* value)
{
    constexpr int terminated = 3;
    if (kind != terminated) return status_discard;
    *value = 0;
    return status_ok;
}
RICOCHET_FMI_EXPORT int fmi2GetStringStatus(void*, int, const char**)
{
    return status_discard;
}
