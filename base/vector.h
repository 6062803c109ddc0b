// Points and directions of the world: millimetres, right-handed, LPS (x to the left, y to the back,
// z to the head) as ITK has it.
#pragma once

#include <Eigen/Core>

namespace angiospline {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec4 = Eigen::Vector4d;
using Mat3 = Eigen::Matrix3d;
using Points3 = Eigen::Matrix3Xd;  // one point a column

}  // namespace angiospline
