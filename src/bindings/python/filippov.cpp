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

/// SystemAdapters to the caller's functions: one for each field, of which the first has the
/// surfaces as its first guards, the guards of the fields behind them, and the time events.
using SystemAdapters = std::vector<RunAdapter*>;

/// The fields as `Filippov` takes them.
template <std::size_t count>
class PlainFields {
public:
    static constexpr bool unchecked_names = true;
    using State = python::State;
    static constexpr std::size_t surface_count = count;

    PlainFields(SystemAdapters adapters, const Times* times)
        : adapters_(std::move(adapters)), times_(times)
    {
        guard_count = first().table().guard_count(first().adapter()) - count;
    }

    std::size_t guard_count = 0;

    void field(std::size_t region, double t, const State& x, State& dxdt) const
    {
        RunAdapter& of = *adapters_[region];
        of.table().flow(of.adapter(), 0, t, x, dxdt);
    }
    [[nodiscard]] double surface(std::size_t which, double t, const State& x) const
    {
        return first().table().guard(first().adapter(), which, 0, t, x);
    }

    [[nodiscard]] double guard(std::size_t which, double t, const State& x) const
    {
        return first().table().guard(first().adapter(), count + which, 0, t, x);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return first().table().info(first().adapter(), count + which);
    }
    [[nodiscard]] bool enabled(std::size_t which, double t, const State& x) const
    {
        const auto& table = first().table();
        return !table.enabled_at || table.enabled_at(first().adapter(), count + which, 0, t, x);
    }
    void reset(std::size_t which, double t, State& x) const
    {
        const auto& table = first().table();
        if (table.reset) table.reset(first().adapter(), count + which, 0, t, x);
    }

    [[nodiscard]] const Times& time_events() const noexcept { return *times_; }
    void time_reset(double t, State& x) const
    {
        const auto& table = first().table();
        if (table.time_reset) table.time_reset(first().adapter(), 0, t, x);
    }

protected:
    [[nodiscard]] RunAdapter& first() const noexcept { return *adapters_.front(); }

private:
    SystemAdapters adapters_;
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
        RunAdapter& of = this->first();
        return of.table().rate(of.adapter(), {.which = which, .mode = 0}, {t, 1}, x, dxdt);
    }
};

/// What Python asks of the rules, and the adapter of a run.
class FilippovAdapter : public RunAdapter {
public:
    explicit FilippovAdapter(std::vector<std::unique_ptr<RunAdapter>> fields)
        : fields_(std::move(fields))
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
    [[nodiscard]] SystemAdapters adapters() const
    {
        SystemAdapters out;
        for (const auto& field : fields_) out.push_back(field.get());
        return out;
    }

private:
    std::vector<std::unique_ptr<RunAdapter>> fields_;
};

template <class Fields>
class FilippovAdapterOf final : public FilippovAdapter {
    using System = Filippov<Fields>;

public:
    FilippovAdapterOf(std::vector<std::unique_ptr<RunAdapter>> fields, const Times& times,
                      double restoring_rate, const State& x0)
        : FilippovAdapter(std::move(fields)),
          system_(Fields(adapters(), &times), {.restoring_rate = restoring_rate}),
          adapter_(system_, x0)
    {
    }

    [[nodiscard]] const detail::SystemTable<State>& table() const noexcept override
    {
        return detail::system_table<System, State>;
    }
    [[nodiscard]] void* adapter() noexcept override { return &adapter_; }
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
    detail::SystemAdapter<System, State> adapter_;
};

[[nodiscard]] std::unique_ptr<FilippovAdapter> make_adapter(const FilippovSource& source,
                                                            const State& x0)
{
    std::vector<std::unique_ptr<RunAdapter>> fields;
    for (const auto& field : source.fields()) fields.push_back(field->open(x0));
    const auto of =
        [&]<class Fields>(std::type_identity<Fields>) -> std::unique_ptr<FilippovAdapter> {
        return std::make_unique<FilippovAdapterOf<Fields>>(std::move(fields), source.times(),
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

std::unique_ptr<RunAdapter> FilippovSource::open(const State& x0) const
{
    return make_adapter(*this, x0);
}

std::unique_ptr<RunAdapter> FilippovSource::open_implicit(const State& x0) const
{
    return implicit_adapter(open(x0), x0);
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
    return make_adapter(*this, x)->start_mode(t, x, tolerance);
}

State FilippovSource::shares(Mode mode, double t, const State& x) const
{
    return make_adapter(*this, x)->shares(mode, t, x);
}

}  // namespace ricochet::python
