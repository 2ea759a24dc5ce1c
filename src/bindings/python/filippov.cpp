// Fields that meet at switching surfaces, written in Python.
#include <cmath>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "filippov.hpp"
#include "implicit.hpp"
#include "ricochet/filippov.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::python {

namespace {

/// Doors to the caller's functions: one for each field, of which the first has the surfaces as its
/// first guards, the guards of the fields behind them, and the time events.
using Doors = std::vector<RunDoor*>;

/// The fields as `Filippov` takes them.
template <std::size_t count>
class PlainFields {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;
    static constexpr std::size_t surface_count = count;

    PlainFields(Doors doors, const Times* times) : doors_(std::move(doors)), times_(times)
    {
        guard_count = first().table().guard_count(first().door()) - count;
    }

    std::size_t guard_count = 0;

    void field(std::size_t region, double t, const State& x, State& dxdt) const
    {
        RunDoor& of = *doors_[region];
        of.table().flow(of.door(), 0, t, x, dxdt);
    }
    [[nodiscard]] double surface(std::size_t which, double t, const State& x) const
    {
        return first().table().guard(first().door(), which, 0, t, x);
    }

    [[nodiscard]] double guard(std::size_t which, double t, const State& x) const
    {
        return first().table().guard(first().door(), count + which, 0, t, x);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return first().table().info(first().door(), count + which);
    }
    [[nodiscard]] bool enabled(std::size_t which, double t, const State& x) const
    {
        const auto& table = first().table();
        return !table.enabled_at || table.enabled_at(first().door(), count + which, 0, t, x);
    }
    void reset(std::size_t which, double t, State& x) const
    {
        const auto& table = first().table();
        if (table.reset) table.reset(first().door(), count + which, 0, t, x);
    }

    [[nodiscard]] const Times& time_events() const noexcept { return *times_; }
    void time_reset(double t, State& x) const
    {
        const auto& table = first().table();
        if (table.time_reset) table.time_reset(first().door(), 0, t, x);
    }

protected:
    [[nodiscard]] RunDoor& first() const noexcept { return *doors_.front(); }

private:
    Doors doors_;
    const Times* times_;
};

/// The same with rates of the surfaces.
template <std::size_t count>
class RatedFields : public PlainFields<count> {
public:
    using PlainFields<count>::PlainFields;

    [[nodiscard]] double surface_rate(std::size_t which, double t, const State& x,
                                      const State& dxdt) const
    {
        RunDoor& of = this->first();
        return of.table().rate(of.door(), {.which = which, .mode = 0}, {t, 1}, x, dxdt);
    }
};

/// What Python asks of the rules, and the door of a run.
class FilippovDoor : public RunDoor {
public:
    explicit FilippovDoor(std::vector<std::unique_ptr<RunDoor>> fields) : fields_(std::move(fields))
    {
        // One watch for all, since a signal is shown to only one.
        for (std::size_t i = 1; i < fields_.size(); ++i) {
            fields_[i]->share_watch(fields_.front()->watch());
        }
    }

    [[nodiscard]] bool is_free() const noexcept override
    {
        for (const auto& field : fields_) {
            if (!field->is_free()) return false;
        }
        return true;
    }
    [[nodiscard]] SignalWatch& watch() noexcept override { return fields_.front()->watch(); }

    [[nodiscard]] virtual Mode start_mode(double t, const State& x, double tolerance) const = 0;
    [[nodiscard]] virtual State shares(Mode mode, double t, const State& x) const = 0;

protected:
    [[nodiscard]] Doors doors() const
    {
        Doors out;
        for (const auto& field : fields_) out.push_back(field.get());
        return out;
    }

private:
    std::vector<std::unique_ptr<RunDoor>> fields_;
};

template <class Fields>
class FilippovDoorOf final : public FilippovDoor {
    using System = Filippov<Fields>;

public:
    FilippovDoorOf(std::vector<std::unique_ptr<RunDoor>> fields, const Times& times,
                   double restoring_rate, const State& x0)
        : FilippovDoor(std::move(fields)),
          system_(Fields(doors(), &times), {.restoring_rate = restoring_rate}),
          door_(system_, x0)
    {
    }

    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept override
    {
        return detail::system_table<System, State>;
    }
    [[nodiscard]] void* door() noexcept override { return &door_; }
    [[nodiscard]] Mode start_mode(double t, const State& x, double tolerance) const override
    {
        return system_.start_mode(t, x, tolerance);
    }
    [[nodiscard]] State shares(Mode mode, double t, const State& x) const override
    {
        const auto shares = system_.shares(mode, t, x);
        return {shares.begin(), shares.end()};
    }

private:
    System system_;
    detail::Door<System, State> door_;
};

[[nodiscard]] std::unique_ptr<FilippovDoor> make_door(const FilippovSource& source, const State& x0)
{
    std::vector<std::unique_ptr<RunDoor>> fields;
    for (const auto& field : source.fields()) fields.push_back(field->open(x0));
    const auto of = [&]<class Fields>(std::type_identity<Fields>) -> std::unique_ptr<FilippovDoor> {
        return std::make_unique<FilippovDoorOf<Fields>>(std::move(fields), source.times(),
                                                        source.restoring_rate(), x0);
    };
    if (source.surfaces() == 1) {
        return source.is_rated() ? of(std::type_identity<RatedFields<1>>{})
                                 : of(std::type_identity<PlainFields<1>>{});
    }
    return source.is_rated() ? of(std::type_identity<RatedFields<2>>{})
                             : of(std::type_identity<PlainFields<2>>{});
}

}  // namespace

FilippovSource::FilippovSource(std::vector<std::shared_ptr<const Source>> fields,
                               std::size_t surfaces, bool rated, const std::optional<Times>& times,
                               double restoring_rate)
    : fields_(std::move(fields)),
      surfaces_(surfaces),
      rated_(rated),
      times_(times ? *times : Times(std::vector<double>{})),
      restoring_rate_(restoring_rate)
{
    detail::check_restoring_rate(restoring_rate_);
}

std::unique_ptr<RunDoor> FilippovSource::open(const State& x0) const
{
    return make_door(*this, x0);
}

std::unique_ptr<RunDoor> FilippovSource::open_implicit(const State& x0) const
{
    return implicit_door(open(x0), x0);
}

std::vector<std::string> FilippovSource::guard_names() const
{
    std::vector<std::string> names;
    for (std::size_t i = 0; i < surfaces_; ++i) {
        const std::string surface = fields_.front()->guard_names()[i];
        for (const char* kind : {": from below", ": from above", ": exit below", ": exit above"}) {
            names.push_back(surface + kind);
        }
    }
    const std::vector<std::string> all = fields_.front()->guard_names();
    names.insert(names.end(), all.begin() + static_cast<std::ptrdiff_t>(surfaces_), all.end());
    return names;
}

Mode FilippovSource::start_mode_at(double t, const State& x, double tolerance) const
{
    return make_door(*this, x)->start_mode(t, x, tolerance);
}

State FilippovSource::shares(Mode mode, double t, const State& x) const
{
    return make_door(*this, x)->shares(mode, t, x);
}

}  // namespace ricochet::python
