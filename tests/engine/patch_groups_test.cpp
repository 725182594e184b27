#include "transom/patch_groups.h"

#include <gtest/gtest.h>

#include <numeric>

namespace transom {
namespace {

// 20 x 20 patches of a floor, of growing size, and as many of a ceiling.
struct Floors {
  std::vector<PatchPlace> places;
  std::vector<float> areas;
  PatchGroups groups;

  Floors() {
    for (int side = 0; side < 2; ++side)
      for (int j = 0; j < 20; ++j)
        for (int i = 0; i < 20; ++i) {
          places.push_back({glm::vec3(i, j, 5 * side), glm::vec3(0, 0, side ? -1 : 1), side});
          areas.push_back(1 + 0.1f * static_cast<float>(i));
        }
    groups = PatchGroups(places, areas);
  }
  // A radiosity that falls along the floor and is the same all over the ceiling.
  std::vector<float> sloping() const {
    std::vector<float> radiosity;
    for (const PatchPlace& place : places) radiosity.push_back(place.material ? 50.f : 100 - 2 * place.position.x);
    return radiosity;
  }
  std::vector<Share> even_row() const {
    std::vector<Share> row;
    for (int p = 0; p < groups.patch_count(); ++p) row.push_back({p, 1.f / 800});
    return row;
  }
};

TEST(PatchGroups, MeansAreByAreaAndOfOneMaterial) {
  const Floors floors;
  // Whatever the groups are: those of an even light have its value, and the extremes of a sloping one are not reached.
  std::vector<glm::vec4> even(floors.places.size(), glm::vec4(3)), sloping;
  floors.groups.append_means(even);
  ASSERT_EQ(even.size(), static_cast<std::size_t>(floors.groups.patch_count() + floors.groups.group_count()));
  for (const glm::vec4& value : even) EXPECT_FLOAT_EQ(value.x, 3);
  for (const float value : floors.sloping()) sloping.push_back(glm::vec4(value));
  floors.groups.append_means(sloping);
  for (std::size_t g = floors.places.size(); g < sloping.size(); ++g)
    EXPECT_TRUE(std::abs(sloping[g].x - 50) < 1e-4f || (sloping[g].x >= 62 && sloping[g].x <= 100)) << sloping[g].x;
  EXPECT_GT(floors.groups.group_count(), 700);
}

TEST(PatchGroups, AGroupedRowReceivesAsMuchOfTheFirstLightAndAsGoodAsAskedOfOthers) {
  const Floors floors;
  const std::vector<Share> row = floors.even_row();
  std::vector<float> steeper;
  for (const float radiosity : floors.sloping()) steeper.push_back(radiosity * radiosity);
  const std::vector<PatchGroups::TypicalLight> lights{floors.groups.typical(floors.sloping()),
                                                      floors.groups.typical(steeper)};
  std::size_t before = row.size() + 1;
  for (const float tolerance : {0.f, 1e-4f, 1e-3f, 1e-2f}) {
    const std::vector<Share> grouped = floors.groups.grouped(row, lights, tolerance);
    float sum = 0;
    for (const Share& share : grouped) sum += share.weight;
    EXPECT_NEAR(lights[0].received_by(grouped) / lights[0].received_by(row), 1, 1e-5f);
    const float bound = tolerance * static_cast<float>(grouped.size()) + 1e-5f;
    EXPECT_NEAR(lights[1].received_by(grouped) / lights[1].received_by(row), 1, bound);
    EXPECT_NEAR(sum, 1, tolerance + 1e-5f);
    EXPECT_LT(grouped.size(), before);
    before = grouped.size();
  }
  EXPECT_LT(before, 60u);  // the ceiling is even: it is a few groups whatever the tolerance
}

TEST(PatchGroups, WithoutATypicalLightARowStaysAsItIs) {
  const Floors floors;
  EXPECT_EQ(floors.groups.grouped(floors.even_row(), {}, 1), floors.even_row());
}

TEST(PatchGroups, WithoutPatchesThereAreNoGroups) {
  const PatchGroups none({}, {});
  EXPECT_EQ(none.group_count(), 0);
  EXPECT_TRUE(none.grouped({}, {}, 1).empty());
}

}  // namespace
}  // namespace transom
