#include "fmi/export/instance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <new>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace ricochet::fmi::detail {

namespace {

/// A saved state, with the stage of the instance.
struct Saved {
    ModelState model;
    Stage stage;
    bool event_waits;
    double last_time;
};

/// Bytes that `parse` reads again: the stage, then the snapshots, each behind its length.
std::string text_of(const Saved& saved)
{
    const std::string own = to_text(saved.model.own);
    const std::string run = saved.model.run ? to_text(*saved.model.run) : "";
    return fmt::format("ricochet fmu state 1\n{} {} {} {} {}\n{}{}", static_cast<int>(saved.stage),
                       saved.event_waits ? 1 : 0, std::bit_cast<std::uint64_t>(saved.last_time),
                       own.size(), run.size(), own, run);
}

Saved parse(std::string_view text)
{
    const auto refuse = [] { throw std::invalid_argument("the bytes are no state of this model"); };
    int stage = 0, waits = 0, used = 0;
    unsigned long long last_time = 0;
    std::size_t own = 0, run = 0;
    const std::string head(text.substr(0, 200));
    if (std::sscanf(head.c_str(), "ricochet fmu state 1\n%d %d %llu %zu %zu\n%n", &stage, &waits,
                    &last_time, &own, &run, &used) < 5 ||
        used == 0 || stage < 0 || stage > static_cast<int>(Stage::terminated)) {
        refuse();
    }
    text.remove_prefix(static_cast<std::size_t>(used));
    if (own > text.size() || run != text.size() - own) refuse();
    Saved saved{.model = {.own = snapshot_from_text(text.substr(0, own)), .run = {}},
                .stage = static_cast<Stage>(stage),
                .event_waits = waits != 0,
                .last_time = std::bit_cast<double>(std::uint64_t{last_time})};
    if (run > 0) saved.model.run = snapshot_from_text(text.substr(own));
    return saved;
}

/// The path of a folder that a URI names, "file:///a%20b".
std::string path_of(std::string_view uri)
{
    for (const std::string_view start : {"file://localhost/", "file:///", "file:/"}) {
        if (!uri.starts_with(start)) continue;
        uri.remove_prefix(start.size() - 1);
        break;
    }
    std::string path;
    while (!uri.empty()) {
        unsigned char code = 0;
        const char* const digits = uri.data() + 1;
        const bool coded = uri.size() >= 3 && uri[0] == '%' &&
                           std::from_chars(digits, digits + 2, code, 16).ptr == digits + 2;
        path += coded ? static_cast<char>(code) : uri[0];
        uri.remove_prefix(coded ? 3 : 1);
    }
    return path;
}

/// Content of the file that tells the model, in the folder of the resources; empty without one.
std::string read_resource(const char* folder, bool by_uri)
{
    if (folder == nullptr) return {};
    const std::string path = by_uri ? path_of(folder) : std::string(folder);
    std::ifstream file(path + "/model.json", std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

Instance::Instance(bool me, bool events, const ModelSource& source)
    : model_exchange(me),
      event_mode(events),
      resource(source.resource),
      model(make_exported_model(source))
{
}

bool Instance::is_one_of(std::initializer_list<Stage> stages) const noexcept
{
    return stages.size() == 0 || std::ranges::find(stages, stage) != stages.end();
}

int Instance::fail(const std::string& what) noexcept
{
    if (log2 != nullptr) log2(environment, name.c_str(), status_error, "error", "%s", what.c_str());
    if (log3 != nullptr) log3(environment, status_error, "error", what.c_str());
    return status_error;
}

double Instance::get(Reference reference)
{
    const ModelFacts& facts = model->facts();
    const Place place = place_of(facts, reference);
    const auto one_of = [&](void (ExportedModel::*compute)(std::span<double>)) {
        std::vector<double> all(count_of(facts, place.quantity));
        (*model.*compute)(all);
        return all[place.index];
    };
    switch (place.quantity) {
        case Quantity::time: return model->t;
        case Quantity::state: return model->x[place.index];
        case Quantity::parameter: return model->parameters[place.index];
        case Quantity::input: return model->inputs[place.index];
        case Quantity::rate: return one_of(&ExportedModel::rates);
        case Quantity::output: return one_of(&ExportedModel::outputs);
        case Quantity::indicator: return one_of(&ExportedModel::indicators);
        case Quantity::events: return static_cast<double>(model->events);
        case Quantity::mode: return model->mode;
        case Quantity::none: break;
    }
    throw std::invalid_argument(fmt::format("no variable has the value reference {}", reference));
}

void Instance::set(Reference reference, double value)
{
    const Place place = place_of(model->facts(), reference);
    const bool before = stage <= Stage::initialization;
    switch (place.quantity) {
        case Quantity::state:
            if (!before) break;
            model->x[place.index] = value;
            return;
        case Quantity::parameter:
            if (!before &&
                !(model->facts().tunable && (stage == Stage::event || stage == Stage::step))) {
                break;
            }
            model->parameters[place.index] = value;
            model->changed = true;
            return;
        case Quantity::input:
            model->changed = model->changed || model->inputs[place.index] != value;
            model->inputs[place.index] = value;
            return;
        default: break;
    }
    throw std::invalid_argument(
        fmt::format("the variable with the value reference {} cannot be set now", reference));
}

void Instance::start()
{
    model->start();
    last_time = model->t;
    stage = model_exchange || event_mode ? Stage::event : Stage::step;
}

void Instance::step(double t, double h, bool stops_at_events)
{
    if (event_waits) throw std::logic_error("an event waits to be handled in event mode");
    // Communication points of the importer may differ from the time reached by rounding.
    const double allowed = 1e-9 * std::max({std::fabs(t), std::fabs(h), std::fabs(model->t)});
    if (!(std::fabs(t - model->t) <= allowed) || !(h > 0)) {
        throw std::invalid_argument(fmt::format(
            "a step from {} by {} s was asked for; expected one from {} forward", t, h, model->t));
    }
    const ModelStep stepped = model->step(t + h, stops_at_events);
    last_time = model->t;
    event_waits = stepped.event;
    if (!stepped.failure.empty()) throw std::runtime_error(stepped.failure);
}

void Instance::take_states(const double* x, std::size_t count)
{
    if (count != model->x.size()) {
        throw std::invalid_argument(
            fmt::format("{} states were given; expected {}", count, model->x.size()));
    }
    std::copy_n(x, count, model->x.begin());
}

void Instance::give_states(double* x, std::size_t count) const
{
    std::copy_n(model->x.begin(), std::min(count, model->x.size()), x);
}

int unit_nominals(double* nominals, std::size_t count)
{
    std::fill_n(nominals, count, 1.0);
    return status_ok;
}

Instance* make_instance(int version, bool model_exchange, bool event_mode, const char* name,
                        const char* given_token, const char* resources, void* environment,
                        Instance::Log2 log2, Log3 log3) noexcept
{
    try {
        const std::string_view given(given_token != nullptr ? given_token : "");
        const std::string resource = read_resource(resources, version == 2);
        auto made = std::make_unique<Instance>(
            model_exchange, event_mode, ModelSource{.told = told_by(given), .resource = resource});
        made->environment = environment;
        made->log2 = log2;
        made->log3 = log3;
        made->name = name != nullptr ? name : "";
        const ModelFacts& facts = made->model->facts();
        const std::string expected = token(facts, version);
        if (given != expected) {
            made->fail(
                fmt::format("the description is of another model: found the token '{}', "
                            "expected '{}'",
                            given, expected));
            return nullptr;
        }
        if (!(model_exchange ? facts.model_exchange : facts.co_simulation)) {
            made->fail("the interface is not offered");
            return nullptr;
        }
        return made.release();
    } catch (const std::exception&) {
        return nullptr;
    }
}

int get_values(void* handle, const Reference* references, std::size_t count, double* values)
{
    Instance& instance = instance_of(handle);
    return instance.attempt([&] {
        for (std::size_t i = 0; i < count; ++i) values[i] = instance.get(references[i]);
    });
}

int set_values(void* handle, const Reference* references, std::size_t count, const double* values)
{
    Instance& instance = instance_of(handle);
    return instance.attempt([&] {
        for (std::size_t i = 0; i < count; ++i) instance.set(references[i], values[i]);
    });
}

int get_whole(void* handle, const Reference* references, std::size_t count, int* values)
{
    Instance& instance = instance_of(handle);
    return instance.attempt([&] {
        for (std::size_t i = 0; i < count; ++i) {
            values[i] = static_cast<int>(instance.get(references[i]));
        }
    });
}

int reset_instance(void* handle)
{
    Instance& instance = instance_of(handle);
    return instance.attempt([&] {
        instance.model = make_exported_model(
            {.told = instance.model->facts().told, .resource = instance.resource});
        instance.stage = Stage::instantiated;
        instance.event_waits = false;
    });
}

int save_state(void* handle, void** state)
{
    Instance& instance = instance_of(handle);
    return instance.attempt([&] {
        auto saved = std::make_unique<Saved>(Saved{.model = instance.model->save(),
                                                   .stage = instance.stage,
                                                   .event_waits = instance.event_waits,
                                                   .last_time = instance.last_time});
        delete static_cast<Saved*>(*state);
        *state = saved.release();
    });
}

int restore_state(void* handle, void* state)
{
    Instance& instance = instance_of(handle);
    return instance.attempt([&] {
        const Saved& saved = *static_cast<const Saved*>(state);
        instance.model->restore(saved.model);
        instance.stage = saved.stage;
        instance.event_waits = saved.event_waits;
        instance.last_time = saved.last_time;
    });
}

int free_state(void** state)
{
    if (state == nullptr) return status_ok;
    delete static_cast<Saved*>(*state);
    *state = nullptr;
    return status_ok;
}

int state_size(void* handle, void* state, std::size_t* size)
{
    return instance_of(handle).attempt(
        [&] { *size = text_of(*static_cast<const Saved*>(state)).size(); });
}

int write_state(void* handle, void* state, char* bytes, std::size_t size)
{
    return instance_of(handle).attempt([&] {
        const std::string text = text_of(*static_cast<const Saved*>(state));
        if (text.size() != size) throw std::invalid_argument("the state has another size");
        std::memcpy(bytes, text.data(), size);
    });
}

int read_state(void* handle, const char* bytes, std::size_t size, void** state)
{
    return instance_of(handle).attempt([&] {
        auto saved = std::make_unique<Saved>(parse({bytes, size}));
        delete static_cast<Saved*>(*state);
        *state = saved.release();
    });
}

}  // namespace ricochet::fmi::detail
