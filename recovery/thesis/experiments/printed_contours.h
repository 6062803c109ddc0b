// The figures of tables 7.2 to 7.5 as the thesis prints them (7.3.2): contours in a slice.
#pragma once

#include <array>

namespace angiospline::experiments {

// How long a contour moved, and how many points of the slice it then had on the wrong side.
struct ContourOutcome {
  double iterations = 0, missed = 0;
};

// By method: Euler with the pseudo-inverse, Euler with the circulant matrix, central differences,
// Runge-Kutta of first and of fourth order.
using PrintedByMethod = std::array<ContourOutcome, 5>;

// Tables 7.2 and 7.3: right or left artery, gravity or springs, by strength.
inline constexpr PrintedByMethod kRightGravity10{
    {{49, 18}, {37, 20}, {588, 21}, {984, 19}, {573, 20}}};
inline constexpr PrintedByMethod kLeftGravity10{
    {{58, 29}, {36, 36}, {506, 49}, {867, 36}, {527, 35}}};
inline constexpr PrintedByMethod kRightGravity1{
    {{92, 27}, {71, 27}, {600, 32}, {775, 23}, {598, 32}}};
inline constexpr PrintedByMethod kLeftGravity5{
    {{84, 34}, {54, 34}, {635, 35}, {646, 32}, {640, 36}}};
inline constexpr PrintedByMethod kRightSpring20{
    {{93, 26}, {95, 26}, {777, 19}, {773, 19}, {774, 19}}};
inline constexpr PrintedByMethod kRightSpring10{
    {{105, 42}, {69, 38}, {448, 49}, {449, 50}, {447, 49}}};

// Table 7.4: circles that start beside the right artery's centre (voxels) or in another size.
struct PrintedStart {
  double x, y, radius;
  ContourOutcome printed;
};
inline constexpr std::array<PrintedStart, 17> kStartPositions{{{0, 0, 6, {37, 20}},
                                                               {1, 0, 6, {55, 18}},
                                                               {0, 1, 6, {65, 21}},
                                                               {1, 1, 6, {60, 23}},
                                                               {-1, 0, 6, {35, 15}},
                                                               {0, -1, 6, {95, 17}},
                                                               {-1, -1, 6, {60, 21}},
                                                               {0, 2, 6, {96, 27}},
                                                               {2, 0, 6, {35, 24}},
                                                               {1, 2, 6, {120, 37}},
                                                               {2, 1, 6, {161, 31}},
                                                               {2, 2, 6, {78, 42}},
                                                               {0, -2, 6, {30, 23}},
                                                               {-2, 0, 6, {53, 20}},
                                                               {-1, -2, 6, {48, 21}},
                                                               {-2, -1, 6, {90, 23}},
                                                               {-2, -2, 6, {94, 32}}}};
inline constexpr std::array<PrintedStart, 8> kStartSizes{{{0, 0, 3, {33, 18}},
                                                          {0, 0, 4, {33, 18}},
                                                          {0, 0, 5, {31, 18}},
                                                          {0, 0, 6, {37, 20}},
                                                          {0, 0, 7, {55, 18}},
                                                          {0, 0, 8, {25, 23}},
                                                          {0, 0, 9, {29, 17}},
                                                          {0, 0, 10, {25, 17}}}};

// Table 7.5: by the number of the circle's sides.
struct PrintedFineness {
  int sides;
  ContourOutcome printed;
};
inline constexpr std::array<PrintedFineness, 11> kFineness{{{6, {64, 51}},
                                                            {9, {50, 31}},
                                                            {12, {71, 27}},
                                                            {15, {39, 19}},
                                                            {18, {45, 17}},
                                                            {21, {46, 16}},
                                                            {24, {40, 15}},
                                                            {27, {50, 14}},
                                                            {30, {37, 12}},
                                                            {33, {37, 14}},
                                                            {36, {55, 11}}}};

}  // namespace angiospline::experiments
