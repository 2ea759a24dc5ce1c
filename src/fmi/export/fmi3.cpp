// The functions of FMI 3.0, by the names and signatures of the standard, for one exported model.
#include <cstdint>

#include "fmi/export/instance.hpp"

using namespace ricochet::fmi;
using namespace ricochet::fmi::detail;
using Exporting = ricochet::fmi::detail::Instance;

RICOCHET_FMI_EXPORT const char* fmi3GetVersion()
{
    return "3.0";
}
RICOCHET_FMI_EXPORT int fmi3SetDebugLogging(void*, bool, std::size_t, const char* const*)
{
    return status_ok;
}
RICOCHET_FMI_EXPORT void* fmi3InstantiateModelExchange(const char* name, const char* token,
                                                       const char* resources, bool, bool,
                                                       void* environment, Log3 log)
{
    return make_instance(3, true, false, name, token, resources, environment, nullptr, log);
}
RICOCHET_FMI_EXPORT void* fmi3InstantiateCoSimulation(const char* name, const char* token,
                                                      const char* resources, bool, bool,
                                                      bool event_mode, bool early, const Reference*,
                                                      std::size_t, void* environment, Log3 log,
                                                      Update3)
{
    return make_instance(3, false, event_mode && early, name, token, resources, environment,
                         nullptr, log);
}
RICOCHET_FMI_EXPORT void* fmi3InstantiateScheduledExecution(const char*, const char*, const char*,
                                                            bool, bool, void*, Log3, void (*)(),
                                                            void (*)(), void (*)())
{
    return nullptr;
}
RICOCHET_FMI_EXPORT void fmi3FreeInstance(void* c)
{
    delete static_cast<Exporting*>(c);
}
RICOCHET_FMI_EXPORT int fmi3EnterInitializationMode(void* c, bool, double, double start, bool,
                                                    double)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::instantiated}, "fmi3EnterInitializationMode", [&] {
        i.model->t = start;
        i.stage = Stage::initialization;
    });
}
RICOCHET_FMI_EXPORT int fmi3ExitInitializationMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::initialization}, "fmi3ExitInitializationMode", [&] { i.start(); });
}
RICOCHET_FMI_EXPORT int fmi3Terminate(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.stage = Stage::terminated; });
}
RICOCHET_FMI_EXPORT int fmi3Reset(void* c)
{
    return reset_instance(c);
}

// --- event mode ---

RICOCHET_FMI_EXPORT int fmi3EnterEventMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::continuous, Stage::step, Stage::event}, "fmi3EnterEventMode",
                     [&] { i.stage = Stage::event; });
}
RICOCHET_FMI_EXPORT int fmi3UpdateDiscreteStates(void* c, bool* again, bool* end, bool* nominals,
                                                 bool* values, bool* defined, double* next)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::event}, "fmi3UpdateDiscreteStates", [&] {
        *end = *nominals = false;
        if (!i.model_exchange) {
            *again = *defined = false;
            *values = i.event_waits;
            if (i.event_waits) i.model->handle_event();
            i.event_waits = false;
            return;
        }
        const ModelUpdate update = i.model->update();
        *again = update.again;
        *values = update.states_changed;
        *defined = update.next_time < std::numeric_limits<double>::max();
        *next = update.next_time;
    });
}
RICOCHET_FMI_EXPORT int fmi3EvaluateDiscreteStates(void*)
{
    return status_ok;
}

// --- model exchange ---

RICOCHET_FMI_EXPORT int fmi3EnterContinuousTimeMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::event}, "fmi3EnterContinuousTimeMode",
                     [&] { i.stage = Stage::continuous; });
}
RICOCHET_FMI_EXPORT int fmi3CompletedIntegratorStep(void* c, bool, bool* event, bool* end)
{
    *event = *end = false;
    return instance_of(c).attempt({Stage::continuous}, "fmi3CompletedIntegratorStep", [] {});
}
RICOCHET_FMI_EXPORT int fmi3SetTime(void* c, double t)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.model->t = t; });
}
RICOCHET_FMI_EXPORT int fmi3SetContinuousStates(void* c, const double* x, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::continuous}, "fmi3SetContinuousStates", [&] { i.take_states(x, n); });
}
RICOCHET_FMI_EXPORT int fmi3GetContinuousStates(void* c, double* x, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.give_states(x, n); });
}
RICOCHET_FMI_EXPORT int fmi3GetNominalsOfContinuousStates(void*, double* x, std::size_t n)
{
    return unit_nominals(x, n);
}
RICOCHET_FMI_EXPORT int fmi3GetContinuousStateDerivatives(void* c, double* d, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.model->rates({d, n}); });
}
RICOCHET_FMI_EXPORT int fmi3GetEventIndicators(void* c, double* z, std::size_t n)
{
    Exporting& i = instance_of(c);
    return i.attempt([&] { i.model->indicators({z, n}); });
}
RICOCHET_FMI_EXPORT int fmi3GetNumberOfContinuousStates(void* c, std::size_t* n)
{
    *n = instance_of(c).model->x.size();
    return status_ok;
}
RICOCHET_FMI_EXPORT int fmi3GetNumberOfEventIndicators(void* c, std::size_t* n)
{
    *n = instance_of(c).model->facts().guards.size();
    return status_ok;
}

// --- co-simulation ---

RICOCHET_FMI_EXPORT int fmi3EnterStepMode(void* c)
{
    Exporting& i = instance_of(c);
    return i.attempt({Stage::event}, "fmi3EnterStepMode", [&] { i.stage = Stage::step; });
}
RICOCHET_FMI_EXPORT int fmi3DoStep(void* c, double t, double h, bool, bool* event, bool* end,
                                   bool* early, double* reached)
{
    Exporting& i = instance_of(c);
    *event = *end = *early = false;
    return i.attempt({Stage::step}, "fmi3DoStep", [&] {
        i.step(t, h, i.event_mode);
        *event = i.event_waits;
        *reached = i.last_time;
        *early = i.last_time < t + h;
    });
}

// --- values ---

RICOCHET_FMI_EXPORT int fmi3GetFloat64(void* c, const Reference* r, std::size_t n, double* v,
                                       std::size_t)
{
    return get_values(c, r, n, v);
}
RICOCHET_FMI_EXPORT int fmi3SetFloat64(void* c, const Reference* r, std::size_t n, const double* v,
                                       std::size_t)
{
    return set_values(c, r, n, v);
}
RICOCHET_FMI_EXPORT int fmi3GetInt32(void* c, const Reference* r, std::size_t n, std::int32_t* v,
                                     std::size_t)
{
    return get_whole(c, r, n, v);
}

namespace {

int none(void* c, std::size_t n)
{
    return n == 0 ? static_cast<int>(status_ok)
                  : instance_of(c).fail("there are no variables of this type");
}

}  // namespace

// Types of which a model has no variables.
#define RICOCHET_NO_VARIABLES(name, T)                                                        \
    RICOCHET_FMI_EXPORT int fmi3Get##name(void* c, const Reference*, std::size_t n, T*,       \
                                          std::size_t)                                        \
    {                                                                                         \
        return none(c, n);                                                                    \
    }                                                                                         \
    RICOCHET_FMI_EXPORT int fmi3Set##name(void* c, const Reference*, std::size_t n, T const*, \
                                          std::size_t)                                        \
    {                                                                                         \
        return none(c, n);                                                                    \
    }
RICOCHET_NO_VARIABLES(Float32, float)
RICOCHET_NO_VARIABLES(Int8, std::int8_t)
RICOCHET_NO_VARIABLES(UInt8, std::uint8_t)
RICOCHET_NO_VARIABLES(Int16, std::int16_t)
RICOCHET_NO_VARIABLES(UInt16, std::uint16_t)
RICOCHET_NO_VARIABLES(UInt32, std::uint32_t)
RICOCHET_NO_VARIABLES(Int64, std::int64_t)
RICOCHET_NO_VARIABLES(UInt64, std::uint64_t)
RICOCHET_NO_VARIABLES(Boolean, bool)
RICOCHET_NO_VARIABLES(String, const char*)
#undef RICOCHET_NO_VARIABLES
RICOCHET_FMI_EXPORT int fmi3SetInt32(void* c, const Reference*, std::size_t n, const std::int32_t*,
                                     std::size_t)
{
    return none(c, n);
}
RICOCHET_FMI_EXPORT int fmi3GetBinary(void* c, const Reference*, std::size_t n, std::size_t*,
                                      const std::uint8_t**, std::size_t)
{
    return none(c, n);
}
RICOCHET_FMI_EXPORT int fmi3SetBinary(void* c, const Reference*, std::size_t n, const std::size_t*,
                                      const std::uint8_t* const*, std::size_t)
{
    return none(c, n);
}
RICOCHET_FMI_EXPORT int fmi3GetClock(void* c, const Reference*, std::size_t n, bool*)
{
    return none(c, n);
}
RICOCHET_FMI_EXPORT int fmi3SetClock(void* c, const Reference*, std::size_t n, const bool*)
{
    return none(c, n);
}

// --- states ---

RICOCHET_FMI_EXPORT int fmi3GetFMUState(void* c, void** state)
{
    return save_state(c, state);
}
RICOCHET_FMI_EXPORT int fmi3SetFMUState(void* c, void* state)
{
    return restore_state(c, state);
}
RICOCHET_FMI_EXPORT int fmi3FreeFMUState(void*, void** state)
{
    return free_state(state);
}
RICOCHET_FMI_EXPORT int fmi3SerializedFMUStateSize(void* c, void* state, std::size_t* size)
{
    return state_size(c, state, size);
}
RICOCHET_FMI_EXPORT int fmi3SerializeFMUState(void* c, void* state, std::uint8_t* bytes,
                                              std::size_t size)
{
    return write_state(c, state, reinterpret_cast<char*>(bytes), size);
}
RICOCHET_FMI_EXPORT int fmi3DeserializeFMUState(void* c, const std::uint8_t* bytes,
                                                std::size_t size, void** state)
{
    return read_state(c, reinterpret_cast<const char*>(bytes), size, state);
}

// --- what is not offered ---

// In C a function may be called with arguments that it does not read.
#define RICOCHET_NOT_OFFERED(name)                           \
    RICOCHET_FMI_EXPORT int name(void* c)                    \
    {                                                        \
        return instance_of(c).fail(#name " is not offered"); \
    }
RICOCHET_NOT_OFFERED(fmi3GetNumberOfVariableDependencies)
RICOCHET_NOT_OFFERED(fmi3GetVariableDependencies)
RICOCHET_NOT_OFFERED(fmi3GetDirectionalDerivative)
RICOCHET_NOT_OFFERED(fmi3GetAdjointDerivative)
RICOCHET_NOT_OFFERED(fmi3EnterConfigurationMode)
RICOCHET_NOT_OFFERED(fmi3ExitConfigurationMode)
RICOCHET_NOT_OFFERED(fmi3GetIntervalDecimal)
RICOCHET_NOT_OFFERED(fmi3GetIntervalFraction)
RICOCHET_NOT_OFFERED(fmi3GetShiftDecimal)
RICOCHET_NOT_OFFERED(fmi3GetShiftFraction)
RICOCHET_NOT_OFFERED(fmi3SetIntervalDecimal)
RICOCHET_NOT_OFFERED(fmi3SetIntervalFraction)
RICOCHET_NOT_OFFERED(fmi3SetShiftDecimal)
RICOCHET_NOT_OFFERED(fmi3SetShiftFraction)
RICOCHET_NOT_OFFERED(fmi3GetOutputDerivatives)
RICOCHET_NOT_OFFERED(fmi3ActivateModelPartition)
#undef RICOCHET_NOT_OFFERED
