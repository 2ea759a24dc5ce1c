// One instance of an exported model behind the functions of either version of FMI.
#pragma once

#include <exception>
#include <memory>
#include <string>

#include "fmi/api.hpp"
#include "fmi/export/references.hpp"

#define RICOCHET_FMI_EXPORT extern "C" __attribute__((visibility("default")))

namespace ricochet::fmi::detail {

enum class Stage : std::uint8_t {
    instantiated,
    initialization,
    event,
    continuous,
    step,
    terminated,
};

class Instance {
public:
    Instance(bool model_exchange, bool event_mode, const ModelSource& source);

    using Log2 = void (*)(void*, const char*, int, const char*, const char*, ...);

    // What the importer gave.
    void* environment = nullptr;
    Log2 log2 = nullptr;
    Log3 log3 = nullptr;
    std::string name;

    const bool model_exchange, event_mode;
    Stage stage = Stage::instantiated;
    bool event_waits = false;
    double last_time = 0;  ///< [s] reached by the last step
    const std::string resource;
    std::unique_ptr<ExportedModel> model;

    [[nodiscard]] double get(Reference reference);
    void set(Reference reference, double value);
    void start();
    /// Advances from t by h [s]. @throws std::runtime_error with the reason if it cannot
    void step(double t, double h, bool stops_at_events);
    /// @throws std::invalid_argument for another number of states
    void take_states(const double* x, std::size_t count);
    void give_states(double* x, std::size_t count) const;

    /// Logs what went wrong. @return the status Error
    int fail(const std::string& what) noexcept;

    /// Calls `body`, whose exceptions become the status Error; also where the stage is none of
    /// those in which the function may be called.
    template <class Body>
    int attempt(std::initializer_list<Stage> stages, const char* function,
                const Body& body) noexcept
    {
        try {
            if (!is_one_of(stages))
                return fail(std::string(function) + " is called too early or too late");
            body();
            return status_ok;
        } catch (const std::exception& error) {
            return fail(error.what());
        }
    }
    template <class Body>
    int attempt(const Body& body) noexcept
    {
        return attempt({}, "", body);
    }

private:
    [[nodiscard]] bool is_one_of(std::initializer_list<Stage> stages) const noexcept;
};

[[nodiscard]] inline Instance& instance_of(void* handle)
{
    return *static_cast<Instance*>(handle);
}

/// A new instance, or null if the token is another model's or the interface is not offered.
/// @param resources  folder of the resources: a path, or in 2.0 a URI
[[nodiscard]] Instance* make_instance(int version, bool model_exchange, bool event_mode,
                                      const char* name, const char* given_token,
                                      const char* resources, void* environment, Instance::Log2 log2,
                                      Log3 log3) noexcept;

// Functions of both versions.
int unit_nominals(double* nominals, std::size_t count);
int get_values(void* handle, const Reference* references, std::size_t count, double* values);
int set_values(void* handle, const Reference* references, std::size_t count, const double* values);
int get_whole(void* handle, const Reference* references, std::size_t count, int* values);
int reset_instance(void* handle);
int save_state(void* handle, void** state);
int restore_state(void* handle, void* state);
int free_state(void** state);
int state_size(void* handle, void* state, std::size_t* size);
int write_state(void* handle, void* state, char* bytes, std::size_t size);
int read_state(void* handle, const char* bytes, std::size_t size, void** state);

}  // namespace ricochet::fmi::detail
