// A hundred thousand random contact problems: solved to 1e-10, or reported; none loops.

#include <gtest/gtest.h>

#include "random_contacts.hpp"
#include "ricochet/nonsmooth/contact_problem.hpp"

namespace ricochet::contacts_full_test {
namespace {

TEST(ContactSolverFull, SolvesOrReportsRandomProblemsOfUpToFiftyContacts)
{
    testing_support::RandomContacts problem(7);
    ContactSolver solver({.max_sweeps = 300});
    int converged = 0;
    const int problems = 100'000;
    for (int k = 0; k < problems; ++k) {
        problem.draw(k % 10 == 0 ? 50 : 8);
        Eigen::VectorXd p = Eigen::VectorXd::Zero(problem.q.size());
        const ContactReport report =
            solver.solve(problem.w, problem.q, problem.friction, problem.components, p);
        ASSERT_EQ(report.converged, report.residual <= 1e-10);
        ASSERT_LE(report.sweeps, 300);
        converged += report.converged;
    }
    RecordProperty("converged", converged);
    EXPECT_GE(converged, problems * 95 / 100);
}

}  // namespace
}  // namespace ricochet::contacts_full_test
