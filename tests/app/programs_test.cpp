// The further programs, `ricochet-<name>`, that `ricochet` runs.

#include "app.hpp"

#include <cstdlib>
#include <string>

namespace ricochet::programs_test {
namespace {

/// Runs a program directly, in the directory of `ricochet`; returns its status.
int status_of(const std::string& program, const std::string& arguments)
{
    const fs::path file = fs::path(RICOCHET_APP).parent_path() / program;
    const int status =
        std::system(("'" + file.string() + "' " + arguments + " >/dev/null 2>&1").c_str());
    return WEXITSTATUS(status);
}

TEST_F(App, FurtherProgramsRunByThemselves)
{
    EXPECT_EQ(status_of("ricochet-fault", "simulate fault --json"), 0);
    EXPECT_EQ(status_of("ricochet-fault", "simulate bouncing-ball"), 2);
    EXPECT_EQ(status_of("ricochet-nonsmooth", "simulate sliding-mode --json"), 0);
    EXPECT_EQ(status_of("ricochet-nonsmooth", "simulate bouncing-ball"), 2);
    EXPECT_EQ(status_of("ricochet-nonsmooth", "compare bouncing-ball"), 2);
    EXPECT_EQ(status_of("ricochet-ensemble", "--help"), 0);
    EXPECT_EQ(status_of("ricochet-ensemble", "bouncing-ball"), 2);
    EXPECT_EQ(status_of("ricochet-train", "--help"), 0);
    EXPECT_EQ(status_of("ricochet-train", "pendulums --out x.safetensors"), 2);
    EXPECT_EQ(status_of("ricochet-certify", "--help"), 0);
    EXPECT_EQ(status_of("ricochet-certify", "no-such-model"), 2);
}

TEST_F(App, AProgramThatIsNotThereIsNamed)
{
    const fs::path alone = work() / "ricochet";
    fs::copy_file(RICOCHET_APP, alone);
    for (const char* const words :
         {"ensemble bouncing-ball", "train bouncing-ball --out x", "certify x", "simulate fault",
          "simulate spring-slider", "simulate stick-slip", "compare sliding-mode",
          "compare step-control"}) {
        const std::string command = "'" + alone.string() + "' " + words + " >/dev/null 2>'" +
                                    (work() / "err").string() + "'";
        const int status = std::system(command.c_str());
        EXPECT_EQ(WEXITSTATUS(status), 1) << words;
        const std::string err = content(work() / "err");
        EXPECT_NE(err.find("cannot be run"), std::string::npos) << err;
        EXPECT_NE(err.find("target ricochet_"), std::string::npos) << err;
    }
    EXPECT_EQ(std::system(("'" + alone.string() + "' simulate bouncing-ball >/dev/null").c_str()),
              0);
}

}  // namespace
}  // namespace ricochet::programs_test
