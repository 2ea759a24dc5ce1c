// The further programs, `ricochet-<name>`, that `ricochet` runs.

#include "app.hpp"

#include <cstdlib>
#include <map>
#include <string>

#include "ricochet/faults/fault_rate_state.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet {
namespace {

/// The defaults of a system's parameters, by name.
std::map<std::string, double> defaults_of(const nlohmann::json& systems, const std::string& name)
{
    std::map<std::string, double> out;
    for (const nlohmann::json& system : systems) {
        if (system["name"] != name) continue;
        for (const nlohmann::json& p : system["parameters"]) out[p["name"]] = p["default"];
    }
    return out;
}

/// What `ricochet` lists of the systems of another program is written down a second time there.
TEST_F(App, SystemsOfOtherProgramsHaveTheLibrarysDefaults)
{
    const nlohmann::json systems = json({"systems", "--json"});
    const StrikeSlipFault::Parameters p;
    const FaultFriction f;
    const RateStateOptions how;
    const std::map<std::string, double> fault{{"elements", 1},
                                              {"side", p.side},
                                              {"shear_modulus", p.shear_modulus},
                                              {"poisson", p.poisson},
                                              {"density", p.density},
                                              {"damping", p.damping},
                                              {"stress_gradient", p.stress_gradient},
                                              {"residual_friction", p.residual_friction},
                                              {"friction_drop", p.friction_drop},
                                              {"slip_distance", p.slip_distance},
                                              {"overload", p.overload},
                                              {"half_space", 0},
                                              {"tip_corrected", 0},
                                              {"memory", p.memory_limit / 1048576},
                                              {"rate_and_state", 0},
                                              {"a", f.law.a},
                                              {"b", f.law.b},
                                              {"f_star", f.law.f_star},
                                              {"v_star", f.law.v_star},
                                              {"d_rs", f.law.d_rs},
                                              {"law", 0},
                                              {"plate_velocity", f.plate_velocity},
                                              {"slip_rate", f.slip_rate},
                                              {"theta", 0},
                                              {"normal_stress", 0},
                                              {"threshold", how.threshold},
                                              {"order", how.order}};
    EXPECT_EQ(defaults_of(systems, "fault"), fault);

    const RateStateParameters law;
    std::map<std::string, double> slider = defaults_of(systems, "spring-slider");
    EXPECT_EQ(slider["a"], law.a);
    EXPECT_EQ(slider["b"], law.b);
    EXPECT_EQ(slider["f_star"], law.f_star);
    EXPECT_EQ(slider["v_star"], law.v_star);
    EXPECT_EQ(slider["d_rs"], law.d_rs);
}

/// A program by itself, in the directory of `ricochet`.
int status_of(const std::string& program, const std::string& arguments)
{
    const fs::path file = fs::path(RICOCHET_APP).parent_path() / program;
    const int status = std::system(("'" + file.string() + "' " + arguments + " >/dev/null 2>&1").c_str());
    return WEXITSTATUS(status);
}

TEST_F(App, FurtherProgramsRunByThemselves)
{
    EXPECT_EQ(status_of("ricochet-fault", "simulate fault --json"), 0);
    EXPECT_EQ(status_of("ricochet-fault", "simulate bouncing-ball"), 2);
    EXPECT_EQ(status_of("ricochet-train", "--help"), 0);
    EXPECT_EQ(status_of("ricochet-train", "pendulums --out x.safetensors"), 2);
    EXPECT_EQ(status_of("ricochet-certify", "--help"), 0);
    EXPECT_EQ(status_of("ricochet-certify", "no-such-model"), 2);
    EXPECT_EQ(status_of("ricochet-studies", "compare bouncing-ball"), 2);
}

TEST_F(App, AProgramThatIsNotThereIsNamed)
{
    const fs::path alone = work() / "ricochet";
    fs::copy_file(RICOCHET_APP, alone);
    for (const std::string& words : {"train bouncing-ball --out x", "certify x", "simulate fault",
                                     "simulate spring-slider", "compare step-control"}) {
        const std::string command =
            "'" + alone.string() + "' " + words + " >/dev/null 2>'" + (work() / "err").string() + "'";
        const int status = std::system(command.c_str());
        EXPECT_EQ(WEXITSTATUS(status), 1) << words;
        const std::string err = content(work() / "err");
        EXPECT_NE(err.find("cannot be run"), std::string::npos) << err;
        EXPECT_NE(err.find("target ricochet_"), std::string::npos) << err;
    }
    EXPECT_EQ(std::system(("'" + alone.string() + "' simulate bouncing-ball >/dev/null").c_str()), 0);
}

}  // namespace
}  // namespace ricochet
