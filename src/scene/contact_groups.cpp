// Groups in lasting contact for the loop of a scene.
#include <fmt/format.h>

#include <memory>
#include <utility>

#include "ricochet/scene/simulate.hpp"
#include "scene/contact_island.hpp"
#include "scene/lasting.hpp"

namespace ricochet {

namespace {

using namespace detail;

class Group final : public LastingContact {
public:
    Group(IslandSetup setup, const IslandOptions& options) : island_(std::move(setup), options, 0)
    {
    }

    Plan plan(double longest) override
    {
        const auto [outcome, length] = island_.plan(island_.t() + longest);
        return {outcome,
                length,
                island_.planned_step(),
                island_.failure().residual,
                island_.wake_time() - island_.t(),
                island_.rebounds()};
    }
    void commit(double s) override { island_.commit(s); }
    std::array<double, 2> chord(std::uint32_t id) const override { return island_.chord(id); }
    double chord_spin(std::uint32_t id) const override { return island_.chord_spin(id); }
    IslandBody body(std::uint32_t id) const override { return island_.body(id); }
    void set_crowded(bool crowded) override { island_.set_crowded(crowded); }
    void set_velocity(std::uint32_t id, const std::array<double, 2>& velocity) override
    {
        island_.set_velocity(id, velocity);
    }
    void set_spin(std::uint32_t id, double spin) override { island_.set_spin(id, spin); }
    std::vector<std::vector<std::uint32_t>> groups() const override { return island_.groups(); }
    std::vector<IslandContact> contacts() const override { return island_.contacts(); }
    std::vector<IslandContact> arrivals() const override { return island_.arrivals(); }
    std::string failure() const override
    {
        return fmt::format("the contact law was left with a residual of {:.3g}",
                           island_.failure().residual);
    }

private:
    ContactIsland island_;
};

class Maker final : public SceneContacts {
public:
    std::unique_ptr<LastingContact> make(IslandSetup setup,
                                         const IslandOptions& options) const override
    {
        return std::make_unique<Group>(std::move(setup), options);
    }
};

}  // namespace

const SceneContacts* scene_contacts() noexcept
{
    static const Maker maker;
    return &maker;
}

}  // namespace ricochet
