#include <dlfcn.h>
#include <fmt/format.h>

#include <string>

#include "fmi/unpacked.hpp"

namespace ricochet::fmi {

namespace {

std::string last_error()
{
    const char* const error = dlerror();
    return error != nullptr ? error : "unknown error";
}

/// Looks up functions by their names without the prefix of the version.
class Symbols {
public:
    Symbols(void* library, int version, std::string file)
        : library_(library), prefix_(fmt::format("fmi{}", version)), file_(std::move(file))
    {
    }

    template <class F>
    void optional(F& function, const char* name) const
    {
        function = reinterpret_cast<F>(dlsym(library_, (prefix_ + name).c_str()));
    }

    template <class F>
    void needed(F& function, const char* name) const
    {
        optional(function, name);
        if (function == nullptr) {
            throw Error(fmt::format("{}: has no function {}{}, which its description promises",
                                    file_, prefix_, name));
        }
    }

private:
    void* library_;
    std::string prefix_, file_;
};

void load_motion(const Symbols& from, Functions& f, bool two)
{
    from.needed(f.enter_event, "EnterEventMode");
    from.needed(f.enter_continuous, "EnterContinuousTimeMode");
    from.needed(f.set_time, "SetTime");
    from.needed(f.set_states, "SetContinuousStates");
    from.needed(f.get_states, "GetContinuousStates");
    from.needed(f.get_nominals, "GetNominalsOfContinuousStates");
    from.needed(f.derivatives, two ? "GetDerivatives" : "GetContinuousStateDerivatives");
    from.needed(f.indicators, "GetEventIndicators");
}

void load2(const Symbols& from, Functions& f, const Interface& interface, Kind kind)
{
    from.needed(f.instantiate2, "Instantiate");
    from.needed(f.setup2, "SetupExperiment");
    from.needed(f.enter_initialization2, "EnterInitializationMode");
    from.needed(f.get_real2, "GetReal");
    from.needed(f.set_real2, "SetReal");
    from.needed(f.get_integer2, "GetInteger");
    from.needed(f.set_integer2, "SetInteger");
    from.needed(f.get_boolean2, "GetBoolean");
    from.needed(f.set_boolean2, "SetBoolean");
    if (kind == Kind::co_simulation) {
        from.needed(f.step2, "DoStep");
        from.optional(f.boolean_status2, "GetBooleanStatus");
        from.optional(f.real_status2, "GetRealStatus");
        return;
    }
    load_motion(from, f, true);
    from.needed(f.update2, "NewDiscreteStates");
    from.needed(f.completed2, "CompletedIntegratorStep");
    if (interface.directional_derivatives) {
        from.needed(f.directional2, "GetDirectionalDerivative");
    }
}

void load_values3(const Symbols& from, Functions& f)
{
    from.needed(f.get_float64, "GetFloat64");
    from.needed(f.set_float64, "SetFloat64");
    from.needed(f.get_float32, "GetFloat32");
    from.needed(f.set_float32, "SetFloat32");
    from.needed(f.get_int8, "GetInt8");
    from.needed(f.set_int8, "SetInt8");
    from.needed(f.get_uint8, "GetUInt8");
    from.needed(f.set_uint8, "SetUInt8");
    from.needed(f.get_int16, "GetInt16");
    from.needed(f.set_int16, "SetInt16");
    from.needed(f.get_uint16, "GetUInt16");
    from.needed(f.set_uint16, "SetUInt16");
    from.needed(f.get_int32, "GetInt32");
    from.needed(f.set_int32, "SetInt32");
    from.needed(f.get_uint32, "GetUInt32");
    from.needed(f.set_uint32, "SetUInt32");
    from.needed(f.get_int64, "GetInt64");
    from.needed(f.set_int64, "SetInt64");
    from.needed(f.get_uint64, "GetUInt64");
    from.needed(f.set_uint64, "SetUInt64");
    from.needed(f.get_boolean3, "GetBoolean");
    from.needed(f.set_boolean3, "SetBoolean");
}

void load3(const Symbols& from, Functions& f, const Interface& interface, Kind kind)
{
    from.needed(f.enter_initialization3, "EnterInitializationMode");
    from.needed(f.update3, "UpdateDiscreteStates");
    load_values3(from, f);
    if (kind == Kind::co_simulation) {
        from.needed(f.instantiate_cs3, "InstantiateCoSimulation");
        from.needed(f.step3, "DoStep");
        from.needed(f.enter_event, "EnterEventMode");
        from.needed(f.enter_step3, "EnterStepMode");
        return;
    }
    from.needed(f.instantiate_me3, "InstantiateModelExchange");
    load_motion(from, f, false);
    from.needed(f.completed3, "CompletedIntegratorStep");
    from.needed(f.count_states3, "GetNumberOfContinuousStates");
    from.needed(f.count_indicators3, "GetNumberOfEventIndicators");
    if (interface.directional_derivatives) {
        from.needed(f.directional3, "GetDirectionalDerivative");
    }
}

}  // namespace

Library::Library(const std::filesystem::path& file, const Description& d, Kind kind)
{
    const std::string shown = fmt::format("{}/binaries/{}/{}", d.file, platform_folder(d.version),
                                          file.filename().string());
    if (!std::filesystem::exists(file)) {
        throw Error(fmt::format("{}: is not there; expected a library for this platform", shown));
    }
    handle_ = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (handle_ == nullptr) {
        const std::string why = last_error();
        const bool python = why.find("undefined symbol: Py") != std::string::npos ||
                            why.find("undefined symbol: _Py") != std::string::npos;
        throw Error(fmt::format("{}: cannot be loaded: {}{}", shown, why,
                                python ? "; it needs an interpreter of Python around it: use "
                                         "ricochet.load_fmu there, or LD_PRELOAD its libpython"
                                       : ""));
    }
    try {
        const Symbols from(handle_, d.version, shown);
        const Interface& interface =
            kind == Kind::co_simulation ? *d.co_simulation : *d.model_exchange;
        from.needed(functions.exit_initialization, "ExitInitializationMode");
        from.needed(functions.terminate, "Terminate");
        from.needed(functions.free, "FreeInstance");
        if (interface.saves_state) {
            const bool two = d.version == 2;
            from.needed(functions.keep_state, two ? "GetFMUstate" : "GetFMUState");
            from.needed(functions.set_kept_state, two ? "SetFMUstate" : "SetFMUState");
            from.needed(functions.free_state, two ? "FreeFMUstate" : "FreeFMUState");
        }
        d.version == 2 ? load2(from, functions, interface, kind)
                       : load3(from, functions, interface, kind);
    } catch (...) {
        dlclose(handle_);
        throw;
    }
}

Library::~Library()
{
    if (handle_ != nullptr) dlclose(handle_);
}

}  // namespace ricochet::fmi
